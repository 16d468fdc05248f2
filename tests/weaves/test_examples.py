"""The draft files that come with the tree as examples."""

from pathlib import Path

from weaves.draft_files.read import read_draft
from weaves.draft_files.to_fabric import fabric_of
from weaves.fabric import load_fabric

EXAMPLES = Path(__file__).parents[2] / "weaves" / "examples"


def test_the_houndstooth_is_a_twill_of_four_and_four():
    draft = read_draft(EXAMPLES / "houndstooth.wif")
    found = fabric_of(draft, load_fabric("denim"), "houndstooth", "houndstooth.wif", {"warp": {}, "weft": {}}).fabric
    assert found.weave.rows() == ["..##", ".##.", "##..", "#..#"]
    assert found.colours is not None and found.yarns_per_cm == (18.0, 16.0)
    order = [name for name, count in found.colours.ends for _ in range(count // 4)]
    brown, cream, red = dict.fromkeys(order)
    assert order == [brown, cream, brown, cream, brown, red] and found.colours.picks == found.colours.ends
