"""The scripts of docs/blender.md, run by Blender's own module on maps that the page's command made."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jobs.cli import main

ROOT = Path(__file__).parents[5]


@pytest.mark.slow
def test_blender_renders_the_sample_and_the_maps(tmp_path, monkeypatch):
    pytest.importorskip("bpy", reason="Blender's module is not installed: pip install bpy")
    monkeypatch.chdir(tmp_path)
    assert main(["export", "denim", "--maps", "pictures/denim", "--size", "512"]) == 0
    scripts = re.findall(r"^```python\n(.*?)^```$", (ROOT / "docs/blender.md").read_text(encoding="utf-8"), re.M | re.S)
    assert len(scripts) == 1
    for script in scripts:
        exec(compile(script, "docs/blender.md", "exec"), {})
    with Image.open("sample.png") as picture:
        shown = np.asarray(picture.convert("RGB")).astype(float) / 255
    cloth = shown[shown.max(axis=-1) > 0.02]
    assert len(cloth) > 0.1 * shown[..., 0].size
    red, _, blue = cloth.mean(axis=0)
    assert blue > 1.2 * red  # denim is blue
    assert cloth.std() > 0.03  # folds have light and shadow
