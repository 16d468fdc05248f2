"""What is made once a fabric is made once for equal optics, and never given to another fabric."""

from pipeline.models.per_fabric import PerFabric
from weaves.fabric import load_fabric


def test_equal_optics_share_a_product_and_others_do_not():
    made = []
    products = PerFabric(lambda fabric: made.append(fabric.name) or len(made))
    denim = load_fabric("denim")
    renamed = denim.model_copy(update={"name": "jeans"})
    assert products.of(denim) == products.of(denim) == products.of(renamed) == 1
    assert products.of(load_fabric("basket")) == 2
    assert made == ["denim", "basket"]


def test_an_edited_object_at_the_same_address_is_not_mistaken():
    products = PerFabric(lambda fabric: fabric.warp.roughness)
    denim = load_fabric("denim")
    for roughness in (0.1, 0.2, 0.3, 0.4):
        # Each is dropped at once, so that addresses would be used again if nobody held on to them.
        warp = denim.warp.model_copy(update={"roughness": roughness})
        assert products.of(denim.model_copy(update={"warp": warp})) == roughness
