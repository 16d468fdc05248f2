"""The page docs/mitsuba.md: its example is run as it stands, or with few small pixels where there is no LLVM.

With TWILLIGHT_WRITE_PICTURES=1 (`make pictures`) the picture is written to `docs/pictures`, not compared.
"""

import os
import re
import runpy
import shutil
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from pipeline.mitsuba.worn import PIXEL, ClothOptions
from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.variant import llvm_works, mitsuba

pytestmark = pytest.mark.external  # a renderer with a compiler of its own

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "mitsuba.md").read_text(encoding="utf-8")
KEPT = ROOT / "docs" / "pictures" / "cloth.png"


@pytest.fixture
def mi():
    """Return Mitsuba in the variant that the import would choose, without its warning of the scalar one."""
    import mitsuba as mi

    before = mi.variant()
    yield mitsuba()
    if before is not None:
        mi.set_variant(before)


@pytest.fixture
def example(mi, tmp_path, monkeypatch):
    """Return a function that runs the example of the page and returns its picture."""
    (code,) = re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S)
    monkeypatch.chdir(tmp_path)

    def run(**changed):
        text = code
        for old, new in changed.values():
            assert text.count(old) == 1
            text = text.replace(old, new)
        exec(compile(text, "mitsuba.md", "exec"), {})
        return matplotlib.image.imread(tmp_path / "cloth.png")[..., :3].astype(float)

    return run


@pytest.mark.slow
@pytest.mark.skipif(not llvm_works(), reason="no LLVM that Mitsuba can use")
def test_the_example_is_the_picture_of_the_page(example, tmp_path):
    """But for its noise: 64 samples of other random numbers are as far away."""
    picture = example(samples=("spp=8", "spp=64"))
    if os.environ.get("TWILLIGHT_WRITE_PICTURES"):
        shutil.copyfile(tmp_path / "cloth.png", KEPT)
    kept = matplotlib.image.imread(KEPT)[..., :3].astype(float)
    assert picture.shape == kept.shape and np.abs(picture - kept).mean() < 4 / 255


def test_the_example_with_small_pixels(example):
    picture = example(size=('"width": 384, "height": 256', '"width": 12, "height": 8'), samples=("spp=8", "spp=1"))
    assert picture.shape == (8, 12, 3) and 0.2 < picture.mean() < 0.9 and picture.std() > 0.05


@pytest.mark.slow
def test_the_cover_shows_yarns_from_40_pixels_down_to_less_than_one(mi):
    cover, size = runpy.run_path(str(ROOT / "docs" / "pictures" / "cover.py")), (32, 16)
    seen = render(load(cover["SCENE"]), size=size).gbuffers["tartan"]
    pixels = PIXEL / np.sqrt(seen.sigma * seen.sigma_minor) * cover["SIZE"][0] / size[0]
    assert pixels.max() > 40.0 and pixels.min() < 1.0
    picture = np.asarray(cover["displayed"](cover["rendered"](size)))
    assert picture.shape == (16, 32, 3) and picture[0].min() > 150 and picture[-4:].std() > 20.0


def test_the_page_has_every_property():
    (table,) = re.findall(r"\| property \|.*?\n\n", PAGE, re.S)
    named = re.findall(r"`(\w+)`", " ".join(row.split("|")[1] for row in table.splitlines()[2:] if "|" in row))
    assert set(named) == set(ClothOptions.model_fields)
