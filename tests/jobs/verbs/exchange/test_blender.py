"""The scripts of docs/blender.md, run by Blender's own module on maps that the page's command made."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jobs.cli import main

ROOT = Path(__file__).parents[4]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:'Material.use_nodes':DeprecationWarning")
def test_blender_renders_the_sample_and_the_maps(tmp_path, monkeypatch):
    pytest.importorskip("bpy", reason="Blender's module is not installed: pip install bpy")
    monkeypatch.chdir(tmp_path)
    assert main(["export", "denim", "--maps", "pictures/denim", "--size", "512"]) == 0
    scripts = re.findall(r"^```python\n(.*?)^```$", (ROOT / "docs/blender.md").read_text(encoding="utf-8"), re.M | re.S)
    assert len(scripts) == 2
    for script in scripts:
        exec(compile(script, "docs/blender.md", "exec"), {})
    sample, plane = shown("sample.png"), shown("plane.png")
    cloth = sample[sample.max(axis=-1) > 0.02]
    assert len(cloth) > 0.1 * sample[..., 0].size
    red, _, blue = cloth.mean(axis=0)
    assert blue > 1.2 * red  # denim is blue
    assert cloth.std() > 0.03  # folds have light and shadow
    # The plane fills the picture: a quarter of the cells is the grey weft, the rest the blue warp.
    lit = plane[plane.max(axis=-1) > 0.15]
    grey = np.abs(lit[:, 2] - lit[:, 0]) < 0.1
    assert len(lit) > 0.6 * plane[..., 0].size and 0.1 < grey.mean() < 0.4
    assert (lit[~grey, 2] > 1.3 * lit[~grey, 0]).mean() > 0.9
    # Voile with the sun behind it: yarns let light through, denim none.
    assert main(["export", "voile", "--maps", "pictures/voile", "--size", "128"]) == 0
    behind = [
        scripts[1].replace("radians(50), 0", "radians(130), 0").replace("/denim", f"/{name}")
        for name in ("voile", "denim")
    ]
    for script, least, most in zip(behind, (0.1, 0.0), (1.0, 0.02), strict=True):
        exec(compile(script, "docs/blender.md", "exec"), {})
        assert least <= np.median(shown("plane.png").max(axis=-1)) <= most


def shown(name):
    """Return a picture as shares of white, (H, W, 3)."""
    with Image.open(name) as picture:
        return np.asarray(picture.convert("RGB")).astype(float) / 255
