import numpy as np
import pytest

from tests.refusals import refusal
from tests.weaves.draft_files.drafts import BALANCED_ROWS, numbered, wif
from weaves.colour import linear_rgb
from weaves.draft_files.read import read_draft
from weaves.draft_files.to_fabric import fabric_of
from weaves.fabric import PRESETS, load_fabric

denim, voile = load_fabric("denim"), load_fabric("voile")
NOTHING = {"warp": {}, "weft": {}}


@pytest.fixture
def imported(tmp_path):
    def call(text, like=denim, given=NOTHING):
        path = tmp_path / "small.wif"
        path.write_text(text, encoding="utf-8", newline="")
        return fabric_of(read_draft(path), like, "cloth", "small.wif", given)

    return call


def test_a_twill_with_its_size_and_the_yarns_of_denim(imported, tmp_path):
    found = imported(wif())
    fabric = found.fabric
    assert fabric.weave.rows() == BALANCED_ROWS and fabric.yarns_per_cm == (23.62, 3.937) and fabric.colours is None
    assert (fabric.warp.width, fabric.weft.width) == (0.75, 0.5)
    assert fabric.warp.optics() | {"width": 1.0} == denim.warp.optics()
    assert fabric.weft.optics() | {"width": 1.0} == denim.weft.optics()
    assert fabric.warp.specular_rgb == denim.warp.specular_rgb
    (tmp_path / "cloth.toml").write_text(fabric.to_toml(), encoding="utf-8", newline="")
    assert load_fabric(tmp_path / "cloth.toml") == fabric


def test_a_draft_of_214_threads_with_nine_colours_is_plain(imported):
    """One of a public archive: the structure is a plain weave, the colours repeat after all 214 threads."""
    colours = [1 + (thread * thread // 7) % 9 for thread in range(214)]
    yarns, threads = "Threads=214\nSpacing=.2\nThickness=.23\nUnits=centimeters", numbered([1, 2] * 107)
    text = wif(
        COLOR_TABLE=numbered([f"{25 * k},{255 - 20 * k},80" for k in range(10)]), WARP=yarns, WEFT=yarns,
        WARP_COLORS=numbered(colours), WEFT_COLORS=numbered(colours[::-1]),
        THREADING=threads, TIEUP="1=1\n2=2", TREADLING=threads,
    )  # fmt: skip
    found = imported(text)
    fabric = found.fabric
    assert fabric.weave.rows() == [".#", "#."] and fabric.colours is not None and len(fabric.colours.palette) == 9
    ends, picks = fabric.colours.threads("ends"), fabric.colours.threads("picks")
    assert len(ends) == len(picks) == 214 and ends == picks[::-1]
    # The greenest makes light: all are dimmed alike.
    read = np.array([linear_rgb(fabric.colours.palette[name].diffuse) for name in ends])
    stated = np.array([linear_rgb(f"#{25 * (k - 1):02x}{255 - 20 * (k - 1):02x}50") for k in colours])
    np.testing.assert_allclose(read, stated * fabric.weft.most_diffuse(2.0)[1], atol=1.1e-6)
    assert (fabric.warp.width, fabric.weft.width) == (1.0, 1.0)
    assert sum("1.15 of the spacing" in sentence for sentence in found.assumed) == 2


@pytest.mark.slow
def test_the_largest_draft_reads_back_from_its_fabric_file(imported, tmp_path):
    """4,096 ends and picks in 256 colours without a run of two."""
    threads, four = range(4096), numbered([1, 2, 3, 4] * 1024)
    text = wif(
        COLOR_TABLE=numbered([f"{k},{255 - k},{k * 7 % 256}" for k in range(256)]),
        WARP="Threads=4096\nColor=1", WEFT="Threads=4096\nColor=2",
        WARP_COLORS=numbered([1 + (t * (t // 2 + 1)) % 255 + t % 2 for t in threads]),
        WEFT_COLORS=numbered([1 + t * t // 3 * 2 % 254 + t % 2 for t in threads]), THREADING=four, TREADLING=four,
    )  # fmt: skip
    found = imported(text)
    assert len(found.fabric.colours.threads("ends")) == len(found.fabric.colours.threads("picks")) == 4096
    (tmp_path / "large.toml").write_text(found.fabric.to_toml(), encoding="utf-8", newline="")
    assert load_fabric(tmp_path / "large.toml") == found.fabric


def test_stripes_in_the_ends_alone_and_a_shipped_twill_of_four_and_four(imported):
    fabric = imported(wif(WARP_COLORS=numbered([1, 1, 1, 2] * 2))).fabric
    assert fabric.colours.ends == (("colour_1", 3), ("colour_2", 1)) and fabric.colours.picks == ()
    assert fabric.warp.diffuse == fabric.colours.palette["colour_1"].diffuse != fabric.weft.diffuse
    path = PRESETS.parent / "examples" / "houndstooth.wif"
    fabric = fabric_of(read_draft(path), denim, "houndstooth", "houndstooth.wif", NOTHING).fabric
    assert fabric.weave.rows() == ["..##", ".##.", "##..", "#..#"]
    assert fabric.colours is not None and fabric.yarns_per_cm == (18.0, 16.0)
    order = [name for name, count in fabric.colours.ends for _ in range(count // 4)]
    brown, cream, red = dict.fromkeys(order)
    assert order == [brown, cream, brown, cream, brown, red] and fabric.colours.picks == fabric.colours.ends


def test_colours_that_would_make_light_are_dimmed_alike_and_leave_none_to_go_through(imported):
    found = imported(wif())
    warp, weft = found.fabric.warp, found.fabric.weft
    factor = min(warp.most_diffuse(2.0))
    np.testing.assert_allclose(warp.diffuse_rgb, [factor] * 3, atol=1e-6)
    np.testing.assert_allclose(weft.diffuse_rgb, factor * np.array(linear_rgb("#aa1020")), atol=1e-6)
    said = f"Colours as bright as the file's would send back more light than arrives: all are taken times {factor:.3f}"
    assert any(sentence.startswith(said) for sentence in found.assumed)
    dull = imported(wif(COLOR_TABLE="1=200,200,200\n2=170,16,32"))
    assert (dull.fabric.warp.diffuse, dull.fabric.weft.diffuse) == ("#c8c8c8", "#aa1020")
    assert not any("light than arrives" in sentence for sentence in dull.assumed)
    found = imported(wif(), like=voile)
    assert found.fabric.warp.diffuse_transmission_rgb == (0.0, 0.0, 0.0)
    assert found.fabric.weft.diffuse_transmission_rgb[1] == pytest.approx(voile.weft.diffuse_transmission_rgb[1])
    assert any("the light through" in sentence for sentence in found.assumed)


def test_everything_assumed_is_said_and_kept(imported):
    found = imported(
        wif(WARP="Threads=8\nColor=1", WEFT="Threads=8\nColor=2"), given={"warp": {"bend": 20.5}, "weft": {}}
    )
    text = " ".join(found.assumed)
    for said in ("width 1 is that of denim", "size", "bend 20.5° and 38°", "warp.bend", "twist -30° and -30°", "sRGB"):
        assert said in text
    assert found.fabric.yarns_per_cm is None and found.fabric.warp.bend == 20.5
    assert all(sentence in found.fabric.source for sentence in (*found.read, *found.assumed))
    assert "'Small cloth', written by Loom 2, from small.wif" in found.fabric.source


def test_a_last_repeat_that_is_not_whole_is_left_out_and_loose_layers_are_said(imported):
    found = imported(wif(WARP="Threads=131\nColor=1", THREADING=numbered([end % 4 + 1 for end in range(131)])))
    assert found.fabric.weave.rows() == BALANCED_ROWS
    assert "The last 3 ends do not fill a repeat and are left out." in found.assumed
    # Ends 1 and 3 weave with picks 1 and 3, ends 2 and 4 with picks 2 and 4, the first layer on top.
    found = imported(wif(TIEUP="1=1\n2=1,3,2\n3=3\n4=1,3,4"))
    assert not found.fabric.weave.hangs_together() and any("loose" in sentence for sentence in found.assumed)


UNEVEN = numbered([end * end * end % 4 + 1 for end in range(200)] + [1, 2, 3, 4])
MANY = numbered([f"{k % 256},{k // 256},0" for k in range(300)])


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"THREADING": "1=1\n2=2\n3=3"}, "end 4 of [THREADING]"),
        ({"TREADLING": numbered([1, 2, 3, 4, 1, 2, 3])}, "pick 8 of [TREADLING]"),
        ({"TIEUP": "1=1,2\n2=2,3\n3=3,4\n4=0"}, "pick 4 of [TREADLING]"),
        ({"THREADING": numbered([0, 2, 3, 4] * 2), "TIEUP": "1=1,2\n2=2,3\n3=3,4\n4=0"}, "end 1 of [THREADING]"),
        ({"TIEUP": "1=1,2,3,4\n2=2,3\n3=3,4"}, "pick 1 of [TREADLING]"),
        ({"THREADING": UNEVEN, "WARP": "Threads=311\nColor=1"}, "repeats after 311 ends: at most 256 are allowed"),
        ({"COLOR_TABLE": MANY, "WARP_COLORS": numbered(range(1, 301)), "THREADING": numbered([1, 2, 3, 4] * 75)},
         "[COLOR TABLE]"),
    ],
)  # fmt: skip
def test_what_is_no_cloth_is_refused(imported, change, named):
    assert named in refusal(imported, wif(**change))
