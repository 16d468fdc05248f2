import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.presets import PRESETS
from weaves.count import Count, cover
from weaves.draft import cells
from weaves.fabric import Fabric, load_fabric
from weaves.yarn import Yarn

denim = load_fabric("denim")
unit = st.floats(0, 0.7)  # legal at the usual specular colour and optical thickness
colours = st.one_of(
    st.tuples(unit, unit, unit),
    st.from_regex(r"#([0-9a-dA-D][0-9a-fA-F]){3}", fullmatch=True),
    st.lists(st.floats(0, 0.4), min_size=2, max_size=4).map(
        lambda values: {"wavelengths": [400.0 + 50 * i for i in range(len(values))], "values": values}
    ),
)
yarns = st.fixed_dictionaries(
    {"bend": st.floats(0, 85), "roughness": st.floats(0.01, 1), "twist": st.floats(-89, 89), "diffuse": colours}
)
drafts = st.sampled_from(
    [
        {"family": "plain"},
        {"family": "rib", "ends": 3, "picks": 1},
        {"family": "twill", "over": [3, 1], "under": [1, 2], "direction": "left"},
        {"family": "herringbone", "over": 2, "under": 2},
        {"family": "sateen", "ends": 8, "move": 5},
        {"family": "matrix", "rows": ["#.", ".#"]},
        {"family": "loom", "threading": [1, 2], "tie_up": [[True, False], [0, 1]], "treadling": [1, 2]},
    ]
)
sources = st.text(alphabet=st.characters(exclude_categories=["Cs"]), max_size=30)
palette = {"white": {"diffuse": [0.74, 0.7, 0.6]}, "navy": {"diffuse": "#001030", "specular": [0.1, 0.2, 0.3]}}
order = {"palette": palette, "ends": [["white", 2], ["navy", 1]], "picks": [["white", 5], ["navy", 3]]}
tables = st.fixed_dictionaries(
    {"name": st.just("cloth"), "source": sources, "draft": drafts, "warp": yarns, "weft": yarns},
    optional={"colours": st.just(order), "yarns_per_cm": st.tuples(st.floats(0.1, 1000), st.floats(0.1, 1000))},
)


@settings(max_examples=30)
@given(tables.map(Fabric.model_validate))
def test_a_fabric_reads_back_from_its_own_file(tmp_path_factory, fabric):
    path = tmp_path_factory.mktemp("fabric") / "cloth.toml"
    path.write_text(fabric.to_toml(), encoding="utf-8", newline="")
    assert load_fabric(path) == fabric and Fabric.model_validate(json.loads(fabric.model_dump_json())) == fabric


@pytest.mark.parametrize("name", PRESETS)
def test_preset_is_a_cloth_with_a_source(name):
    fabric = load_fabric(name)
    assert fabric.name == name and ("chosen here" in fabric.source or "Irawan" in fabric.source)
    # It hangs together: every yarn changes side, and no float is so short that it would be drawn flat.
    floats = cells(fabric.weave)
    assert max(floats.top_length.max(), floats.under_length.max()) < float("inf")
    # Warp and weft differ, so that pictures show the weave.
    difference = [abs(a - b) for a, b in zip(fabric.warp.diffuse_rgb, fabric.weft.diffuse_rgb, strict=True)]
    assert max(difference) > 0.05


def test_published_bend_and_twist_of_the_presets():
    """Irawan and Marschner's numbers, warp then weft: bend in degrees, twist in degrees."""
    published = {"polyester_lining": (22, 16, 0), "cotton_twill": (24, 36, -30), "silk_charmeuse": (40, 60, 0)}
    published |= {"wool_gabardine": (30, 30, 30), "denim": (12, 38, -30), "silk_shantung": (50, 23, 0)}
    for name, (warp, weft, twist) in published.items():
        fabric = load_fabric(name)
        assert (fabric.warp.bend, fabric.weft.bend, fabric.warp.twist, fabric.weft.twist) == (warp, weft, twist, twist)


def test_the_physical_size_is_left_out_where_unknown_and_follows_from_counts_and_sett():
    assert "yarns_per_cm" not in denim.model_dump() and "yarns_per_cm" not in denim.to_toml()
    sized = Fabric.model_validate(denim.model_dump() | {"yarns_per_cm": [24, 19.5]})
    assert sized.yarns_per_cm == (24.0, 19.5) and sized.optics() == denim.optics()
    # Peirce's diameter of cotton, 1 / (28 sqrt(Ne)) inches; tex and Ne of one yarn; and area = mass / density.
    table = denim.model_dump(mode="json")
    for yarn, count in (("warp", {"ne": 24}), ("weft", {"tex": 40, "fibre_density": 1.3, "packing": 0.7})):
        del table[yarn]["width"]
        table[yarn] |= count
    fabric = Fabric.model_validate(table | {"sett": [30, 20]})
    assert fabric.yarns_per_cm == (30.0, 20.0) and Fabric.model_validate(fabric.model_dump()) == fabric
    assert fabric.warp.width == pytest.approx(25.4 / (28 * 24**0.5) * 3.0, rel=2e-3)
    area = 0.25 * math.pi * (fabric.weft.width / 2.0) ** 2  # mm^2
    assert area * 1.3 * 0.7 == pytest.approx(40 / 1000)  # mg/mm
    assert Count(ne=24).diameter == pytest.approx(Count(tex=24.606).diameter, rel=1e-4)


def test_cover_and_cut_off_and_the_loom_of_a_cloth():
    """Round yarns hide gaps from cos(angle) = width on; of diagonals the tangent is sqrt(2) 3/4, by the wefts alone."""
    yarns = [denim.warp.model_copy(update={"width": width}) for width in (0.5, 0.8)]
    closed = cover(*yarns)
    assert closed[:4] == pytest.approx((0.5, 0.8, 0.9, 0.1))
    assert [math.cos(math.radians(angle)) for angle in closed[4:]] == pytest.approx([0.8, 0.5, 2.125**-0.5])
    assert cover(denim.warp, yarns[0])[2:] == (1.0, 0.0, 0.0, 0.0, 0.0)
    rows = {"family": "loom", "threading": [2, 1], "tie_up": [[0, 1, 0], [1, 0, 0]], "treadling": [1, 2]}
    loomed = Fabric.model_validate(denim.model_dump() | {"draft": rows})
    assert loomed.loom().threading == (2, 1) and denim.loom().threading == (1, 2, 3, 4)


def test_optics_see_shape_but_neither_colour_name_or_source_nor_how_the_draft_was_written():
    white = denim.warp.model_copy(update={"diffuse": "#ffffff"})
    painted = denim.model_copy(update={"name": "x", "source": "", "warp": white})
    assert painted.optics() == denim.optics() and json.loads(json.dumps(denim.optics())) == denim.optics()
    rows = {"family": "matrix", "rows": [".###", "###.", "##.#", "#.##"]}
    assert Fabric.model_validate(denim.model_dump() | {"draft": rows}).optics() == denim.optics()


@pytest.mark.parametrize("key", sorted(set(Yarn.model_fields) - {"specular", "diffuse", "diffuse_transmission"}))
def test_optics_see_every_number_of_a_yarn(key):
    changed = denim.model_copy(update={"weft": denim.weft.model_copy(update={key: 0.123})})
    assert changed.optics() != denim.optics()
