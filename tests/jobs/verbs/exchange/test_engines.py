"""The page of docs/engines.md, word for word: three.js draws our GLB and our GLSL side by side, in Chromium."""

import base64
import io
import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from jobs.cli import main
from pipeline.shader.languages import slangc
from tests.browser import opened, served

ROOT = Path(__file__).parents[4]


@pytest.mark.external
def test_three_draws_the_sample_its_material_and_the_shader(tmp_path, monkeypatch):
    text = (ROOT / "docs/engines.md").read_text(encoding="utf-8")
    (page,) = re.findall(r"^```html\n(.*?)^```$", text, re.M | re.S)
    (address,) = set(re.findall(r"https://[^/]+/three@[\d.]+", page))
    if slangc() is None or shutil.which("npm") is None:
        pytest.skip("slangc and npm are needed")
    monkeypatch.chdir(tmp_path)
    package = subprocess.run(["npm", "pack", "--silent", address.rpartition("/")[2]], capture_output=True, text=True)
    if package.returncode:
        pytest.skip(f"three.js is not to be had: {package.stderr.strip()[:80]}")
    shutil.unpack_archive(package.stdout.strip())
    assert main(["export", "denim", "--maps", "pictures/denim", "--size", "512"]) == 0
    assert main(["export", "denim", "--shader", "shaders/denim", "--language", "glsles"]) == 0
    Path("three.html").write_text(page.replace(address, "./package"), encoding="utf-8")
    Path("favicon.ico").touch()
    ready = "document.title === 'drawn'"
    with served(tmp_path) as place, opened(f"{place}/three.html", tmp_path / "profile", ready=ready) as browser:
        data = browser.run("document.getElementById('cloth').toDataURL()")
    assert not browser.errors
    shown = np.asarray(Image.open(io.BytesIO(base64.b64decode(data.partition(",")[2]))).convert("RGB")).astype(float)
    if os.environ.get("TWILLIGHT_WRITE_PICTURES"):
        Image.fromarray(shown.astype(np.uint8)).quantize(64).save(ROOT / "docs/pictures/three.png")
    drape, maps, shader = (shown[:, 256 * k : 256 * (k + 1)] for k in range(3))
    cloth = drape[drape.max(axis=-1) > 8]
    assert len(cloth) > 0.2 * drape[..., 0].size and cloth[:, 2].mean() > 1.2 * cloth[:, 0].mean()
    # The same yarns at the same places, in about the same colours; the shader alone has shadows between them.
    blue = [part[..., 2] > 1.4 * part[..., 0] for part in (maps, shader)]
    assert (blue[0] == blue[1]).mean() > 0.85 and 0.4 < blue[1].mean() < 0.9
    np.testing.assert_allclose(maps.mean(axis=(0, 1)), shader.mean(axis=(0, 1)), rtol=0.35)
