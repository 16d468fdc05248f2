from pipeline.per_fabric import PerFabric
from weaves.fabric import load_fabric


def test_equal_optics_share_a_product_and_others_do_not():
    """Objects are dropped at once, so that addresses would be used again if nobody held on to them."""
    made, denim = [], load_fabric("denim")
    products = PerFabric(lambda fabric: made.append(fabric.name) or fabric.warp.roughness)
    assert products.of(denim) == products.of(denim) == denim.warp.roughness
    for roughness in (0.11, 0.12, 0.13, 0.14):
        for name in ("cut", "cut", "jeans"):
            warp = denim.warp.model_copy(update={"roughness": roughness})
            assert products.of(denim.model_copy(update={"name": name, "warp": warp})) == roughness
    assert made == ["denim"] + 4 * ["cut"]
