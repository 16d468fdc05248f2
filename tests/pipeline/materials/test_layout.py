import pytest

from pipeline.materials.layout import Layout, layout
from weaves.errors import BadInput
from weaves.fabric import load_fabric


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("denim", Layout(4, 4, 1024, 1024)),  # 4 x 4
        ("herringbone", Layout(8, 4, 1024, 512)),  # 8 x 4: half as high
        ("pinstripe", Layout(24, 12, 1024, 512)),  # 24 x 4: three repeats high
        ("tartan", Layout(204, 204, 1024, 1024)),
    ],
)
def test_a_map_shows_whole_repeats_in_square_texels(name, expected):
    found = layout(load_fabric(name), 1024)
    assert found == expected
    assert found.width / found.ends == found.height / found.picks


@pytest.mark.parametrize("size", [0, -64, 32, 1000, 8192, 10**6, 10**30])
def test_sizes_that_are_no_power_of_two_in_the_limits_are_refused(size):
    with pytest.raises(BadInput, match="power of two from 64 to 4096"):
        layout(load_fabric("denim"), size)


def test_a_size_too_small_for_the_repeat_names_one_that_is_enough():
    with pytest.raises(BadInput, match="204 ends and 204 picks needs 1024"):
        layout(load_fabric("tartan"), 256)
    assert layout(load_fabric("tartan"), 1024).texels_per_yarn >= 4
