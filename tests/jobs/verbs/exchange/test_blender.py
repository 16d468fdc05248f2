"""The scripts of docs/blender.md, run by Blender's own module on files that the page's commands made."""

import math
import re
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from jobs.cli import main
from pipeline.truth.geometry.first_hit import first_hit, sinking
from pipeline.truth.geometry.heightfield import height_field
from pipeline.truth.geometry.march import ray
from pipeline.truth.geometry.pieces import reference_plane
from weaves.fabric import load_fabric

ROOT = Path(__file__).parents[4]
SCRIPTS = re.findall(r"^```python\n(.*?)^```$", (ROOT / "docs/blender.md").read_text(encoding="utf-8"), re.M | re.S)
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore:'Material.use_nodes':DeprecationWarning")]


def test_blender_renders_the_sample_and_the_maps(tmp_path, monkeypatch):
    pytest.importorskip("bpy", reason="Blender's module is not installed: pip install bpy")
    monkeypatch.chdir(tmp_path)
    scripts = SCRIPTS[:2]
    assert main(["export", "denim", "--maps", "pictures/denim", "--size", "512"]) == 0
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


def test_rays_of_the_shader_of_yarns_end_where_those_of_the_truth_do(tmp_path, monkeypatch):
    bpy = pytest.importorskip("bpy", reason="Blender's module is not installed: pip install bpy")
    monkeypatch.chdir(tmp_path)
    assert main(["export", "denim", "--osl", "denim.osl"]) == 0
    pixels, shows = {}, "links.new({}, nodes.new('ShaderNodeEmission').inputs[0]); links.new(nodes['Emission'].outputs"
    for what in ("coordinates", "yarns.outputs['Place']"):
        script = SCRIPTS[2].replace('links.new(yarns.outputs["BSDF"]', shows.format(what) + "[0]")
        script = script.replace("samples = 16", "samples = 1").replace('"yarns.png"', '"yarns.exr"')
        exec(compile(script.replace("bpy.ops.render.render(write_still=True)", ""), "docs/blender.md", "exec"), {})
        scene = bpy.context.scene
        scene.cycles.use_denoising = False
        scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
        bpy.ops.render.render(write_still=True)
        (pixels[what],) = [c.pixels[::16, ::16, :3] for c in OpenEXR.File("yarns.exr").channels().values()]
    field = height_field(load_fabric("denim"))
    viewer, plane = ray(0.0, -math.sin(math.pi / 3), 0.5, 0.0), reference_plane(field)
    towards, along, _ = sinking(viewer, field.highest, plane)
    seen, places = (values.reshape(-1, 3).astype(float) for values in pixels.values())
    hits = [first_hit(field, 4 * u, 4 * v + along * viewer.dy, field.highest, towards) for u, v, _ in seen]
    y = [4 * v + (along - hit.distance) * viewer.dy for (_, v, _), hit in zip(seen, hits, strict=True)]
    assert len(seen) == 192 and np.ptp(places[:, 2]) > 0.3
    np.testing.assert_allclose(places[:, :2], np.stack([4 * seen[:, 0], y], axis=-1), atol=2e-6)


def shown(name):
    """Return a picture as shares of white, (H, W, 3)."""
    with Image.open(name) as picture:
        return np.asarray(picture.convert("RGB")).astype(float) / 255
