import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.refusals import refusal
from weaves.colour_order import MOST_THREADS, ColourOrder
from weaves.fabric import Fabric, load_fabric
from weaves.validation import validated

PALETTE = {"white": {"diffuse": [0.8, 0.7, 0.6]}, "navy": {"diffuse": "#001030", "specular": [0.1, 0.2, 0.3]}}
denim = load_fabric("denim")


def coloured(**colours):
    return validated(Fabric, denim.model_dump() | {"colours": {"palette": PALETTE} | colours}, "cloth.toml")


def test_threads_have_their_own_colours_and_a_fabric_without_an_order_no_such_key():
    ends, picks = coloured(ends=[["white", 2], ["navy", 1]]).thread_colours()
    assert ends.diffuse[:2].tolist() == [[0.8, 0.7, 0.6]] * 2
    assert ends.specular.tolist() == [list(denim.warp.specular_rgb)] * 2 + [[0.1, 0.2, 0.3]]
    assert picks.diffuse.tolist() == [list(denim.weft.diffuse_rgb)]
    assert "colours" not in denim.model_dump() and coloured(picks=[["navy", 1]]).optics() == denim.optics()
    assert hash(coloured(picks=[["navy", 1]])) == hash(coloured(picks=[["navy", 1]])) != hash(denim)


@settings(max_examples=100)
@given(st.lists(st.tuples(st.sampled_from(["white", "navy"]), st.integers(1, 5)), min_size=1, max_size=6))
def test_a_sequence_repeats_after_its_smallest_repeat(runs):
    order = ColourOrder.model_validate({"palette": PALETTE, "ends": runs})
    written = [name for name, count in runs for _ in range(count)]
    threads = order.threads("ends")
    assert list(threads) * (len(written) // len(threads)) == written
    assert all(threads != threads[k:] + threads[:k] for k in range(1, len(threads)))


@pytest.mark.parametrize(
    ("colours", "named"),
    [
        ({"ends": [["whit", 4]]}, "whit"),
        ({"ends": [["white", 0]]}, "ends"),
        ({"picks": [["white", MOST_THREADS], ["navy", 1]]}, str(MOST_THREADS)),
        ({"palette": {}}, "palette"),
        ({"palette": {"glow": {"diffuse": [1.0] * 3, "diffuse_transmission": [0.5] * 3}}, "ends": [["glow", 1]]},
         "palette.glow"),
    ],
)  # fmt: skip
def test_bad_colours_are_one_sentence(colours, named):
    assert named in refusal(coloured, **colours)
