"""Cards of fabrics: the colours of their threads."""

from reports.images.tiles import EXPOSURE, hex_colour
from reports.page.fabric_card import fabric_card
from weaves.fabric import load_fabric


def shown(rgb):
    return hex_colour([EXPOSURE * value for value in rgb])


def test_a_yarn_has_its_diffuse_and_its_specular_colour():
    denim = load_fabric("denim")
    warp, weft = fabric_card(denim, "seen")["yarns"]
    assert warp["colours"] == [("diffuse", shown(denim.warp.diffuse_rgb)), ("specular", shown(denim.warp.specular_rgb))]
    assert weft["family"] == "weft" and weft["colours"] != warp["colours"]


def test_threads_of_several_colours_have_them_all():
    colours = fabric_card(load_fabric("tartan"), "seen")["yarns"][0]["colours"]
    assert [kind for kind, _ in colours] == ["diffuse"] * 4 + ["specular"] * 2
    assert len(set(colours)) == 6
