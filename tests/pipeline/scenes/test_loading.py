import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.scene import Cloth, Scene
from tests.refusals import refusal

ROOT = Path(__file__).parents[3]
OPTIONS = SceneOptions(variant="scalar_rgb", environment_directions=4, environment_samples=1)
CAMERA = """<sensor type="perspective"><transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/>
</transform><film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="12"/></film></sensor>
"""
SUN = '<emitter type="directional"><vector name="direction" x="0" y="0" z="-1"/></emitter>'
BALL = '<shape type="sphere"><bsdf type="diffuse" id="fabric_denim"/></shape>'
MESH = '<shape type="obj"><string name="filename" value="{}"/><bsdf type="diffuse" id="fabric_denim"/></shape>'
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
PLACED = '<transform name="to_world">{}</transform><bsdf'
MAP = '<texture type="bitmap" name="reflectance"><string name="filename" value="lost.png"/></texture>'

BROKEN = {
    BALL + CAMERA: "a scene needs a light",
    BALL + SUN: "a scene needs a camera",
    BALL + SUN + '<sensor type="thinlens"><float name="aperture_radius" value="0.1"/></sensor>': "must be perspective",
    '<shape type="sphere"/>' + SUN + CAMERA: 'an id such as "fabric_denim"',
    BALL.replace("denim", "denin") + SUN + CAMERA: "did you mean 'denim'?",
    BALL.replace("sphere", "spher") + SUN + CAMERA: "type = 'spher': must be a plugin of Mitsuba itself",
    BALL.replace("sphere", "../sphere") + SUN + CAMERA: "type = '../sphere': must be a plugin of Mitsuba itself",
    BALL.replace("sphere", "$kind") + SUN + CAMERA: "kind",
    BALL + SUN + CAMERA + '<emitter type="spot"/>': "lights must be directional, point, constant or envmap",
    BALL.replace("/></shape>", f">{MAP}</bsdf></shape>") + SUN + CAMERA: "lost.png",
    '<shape type="ply"><string name="filename" value="lost.ply"/></shape>' + BALL + SUN + CAMERA: "lost.ply",
    MESH.format("bare.obj") + SUN + CAMERA: "needs uv coordinates",
    BALL + SUN + CAMERA.replace('"16"', '"16385"'): "film = '16385x12': at most 16,384 pixels a side",
    BALL + SUN + CAMERA.replace("<film", '<float name="fov" value="nan"/><film'): "float fov = 'nan': finite numbers",
    BALL + SUN + CAMERA.replace("0,0,4", "0,inf,4"): "lookat = '0,inf,4': finite numbers",
    BALL + SUN.replace("-1", "1e39") + CAMERA: "vector direction = '1e39': finite numbers",
    BALL.replace("<bsdf", PLACED.format('<scale x="0"/>')) + SUN + CAMERA: "scale x = '0': must not be 0",
    BALL.replace("<bsdf", PLACED.format('<matrix value="1 0 0 0 1 0 0 0 0"/>')) + SUN + CAMERA: "must have an inverse",
    **{
        MESH.format(name).replace("obj", "ply", 1) + SUN + CAMERA: "vertex of a face = 9" for name in ("a.ply", "b.ply")
    },
    MESH.format("a.serialized").replace("obj", "serialized", 1) + SUN + CAMERA: "vertex of a face = 9",
}


PLY = """ply
format {} 1.0
comment faces of a vertex that is not there
element vertex 3
property float x
property float y
property float z
element face 1
property uchar flags
property list uchar int vertex_indices
end_header
"""
PLACES, FACE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32), [0, 1, 9]


def write_meshes_with_lost_vertices(folder):
    (folder / "a.ply").write_text(PLY.format("ascii") + "0 0 0\n1 0 0\n0 1 0\n5 3 0 1 9\n")
    face = struct.pack(">BB3i", 5, 3, *FACE)
    (folder / "b.ply").write_bytes(PLY.format("binary_big_endian").encode() + PLACES.astype(">f4").tobytes() + face)
    mesh = struct.pack("<I5sQQ", 0x1000, b"name", 3, 1) + PLACES.tobytes() + struct.pack("<3I", *FACE)
    header, index = struct.pack("<HH", 0x041C, 4), struct.pack("<QI", 0, 1)
    (folder / "a.serialized").write_bytes(header + zlib.compress(mesh) + index)


def written(folder, body):
    (folder / "bare.obj").write_text(TRIANGLE)
    write_meshes_with_lost_vertices(folder)
    path = folder / "scene.xml"
    path.write_text(f'<scene version="3.0.0">{body}</scene>')
    return path


@pytest.mark.parametrize("body", BROKEN, ids=range(len(BROKEN)))
def test_every_fault_is_one_sentence(body, tmp_path):
    sentence = refusal(lambda: load(load_scene(written(tmp_path, body)), OPTIONS))
    named = next((name for name in ("a.ply", "b.ply", "a.serialized") if name in body), "scene.xml")
    assert BROKEN[body] in sentence and named in sentence and ".cpp" not in sentence


FRESH = """
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
for name in ("scene.xml", "sphere"):
    loaded = load(load_scene(name), SceneOptions(variant="scalar_rgb", environment_directions=4))
    print(len(render(loaded, size=(16, 12)).gbuffers))
"""


def test_plugins_beside_a_scene_or_in_the_current_folder_are_not_loaded(tmp_path, monkeypatch):
    """A file that is no library: Mitsuba would stop at it if it tried, and would run the code of a real one."""
    (tmp_path / "plugins").mkdir()
    used = ("diffuse", "sphere", "rectangle", "hdrfilm", "perspective", "scene", "directional", "stratified", "aov")
    for name in used:
        (tmp_path / "plugins" / f"{name}.so").write_bytes(b"no library")
    monkeypatch.chdir(tmp_path)
    written(tmp_path, BALL + SUN + CAMERA)
    # In a fresh process: this one has loaded Mitsuba's own plugins already.
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", FRESH], capture_output=True, text=True, env=environment, check=False)
    assert done.stdout.split() == ["1", "1"], done.stderr


def test_a_toml_scene_names_its_file_cloths_and_way(tmp_path):
    written(tmp_path, BALL.replace("denim", "trousers") + SUN + CAMERA)
    path = tmp_path / "scene.toml"
    path.write_text('name = "a"\nsource = "scene.xml"\nframes = 30\n[cloths.trousers]\nfabric = "denim"\nturn = 5.0\n')
    scene = load_scene(path)
    assert (scene.frames, scene.cloths["trousers"].turn) == (30, 5.0)
    loaded = load(scene, OPTIONS)
    gbuffer = render(loaded).gbuffers["trousers"]
    assert loaded.cloths["trousers"][1].name == "denim"
    assert gbuffer.mask.shape == (12, 16) and 20 < len(gbuffer.pixel) == gbuffer.mask.sum()
    path.write_text(path.read_text().replace("turn", "trun"))
    assert "trun" in refusal(load_scene, path)


def test_unknown_scenes_and_cloths_are_named(tmp_path):
    assert "did you mean 'drape'?" in refusal(load_scene, "drappe")
    assert "no such file" in refusal(load_scene, tmp_path / "no.toml")
    assert "does not exist" in refusal(load_scene, tmp_path / "no.xml")
    path = written(tmp_path, BALL + SUN + CAMERA)
    scene = Scene(name="a", source=path, cloths={"denim": Cloth(), "voile": Cloth()})
    assert "cloths.voile" in refusal(load, scene, OPTIONS)


@pytest.mark.parametrize(("x", "inside"), [(0.0, True), (0.999, True), (1.001, True), (1.3, False)])
def test_a_camera_inside_the_cloth_is_refused(x, inside, tmp_path):
    """Within the ball, or within a yarn spacing (2 pi / 100 of the radius) of it."""
    path = written(tmp_path, BALL + SUN + CAMERA.replace("0,0,4", f"{x},0.01,0").replace("0,0,0", "-9,0,0"))
    loaded = load(load_scene(path), OPTIONS)
    if inside:
        assert "inside the cloth" in refusal(render, loaded)
    else:
        assert len(render(loaded).gbuffers["denim"].pixel)


def test_a_bent_mesh_without_normals_has_no_curvature(tmp_path):
    """Mitsuba computes normals that a file lacks, unless its facets are wanted; a plane needs none."""
    (tmp_path / "bent.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0.5\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\nf 1/1 2/2 3/3\nf 2/2 4/4 3/3\n"
    )
    facets = '<boolean name="face_normals" value="true"/>'
    path = written(tmp_path, MESH.format("bent.obj").replace("<bsdf", f"{facets}<bsdf") + SUN + CAMERA)
    assert "needs vertex normals, which tell its curvature" in refusal(load, load_scene(path), OPTIONS)
    load(load_scene(path), OPTIONS.model_copy(update={"curvature": "none"}))
    path.write_text(path.read_text().replace(facets, ""))
    load(load_scene(path), OPTIONS)
    path.write_text(path.read_text().replace('value="bent.obj"/>', f'value="bent.obj"/>{facets}'))
    (tmp_path / "bent.obj").write_text((tmp_path / "bent.obj").read_text().replace("1 1 0.5", "1 1 0"))
    load(load_scene(path), OPTIONS)


def test_uv_that_do_not_vary_are_refused_and_shear_where_that_is_an_option(tmp_path):
    path = written(tmp_path, MESH.format("bare.obj") + SUN + CAMERA)
    (tmp_path / "bare.obj").write_text(TRIANGLE.replace("f 1 2 3", "vt 0 0\nf 1/1 2/1 3/1"))
    assert "needs uv coordinates" in refusal(load, load_scene(path), OPTIONS)
    (tmp_path / "bare.obj").write_text(TRIANGLE.replace("f 1 2 3", "vt 0 0\nvt 1 0.5\nvt 0 1\nf 1/1 2/2 3/3"))
    loaded = load(load_scene(path), OPTIONS)
    assert len(render(loaded).gbuffers["denim"].pixel)
    strict = OPTIONS.model_copy(update={"largest_shear": 10.0})
    sentence = refusal(render, load(load_scene(path), strict))
    assert f"sheared by {np.degrees(np.arctan(0.5)):.1f} degrees" in sentence
