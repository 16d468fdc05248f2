import json

import MaterialX
import numpy as np
import OpenEXR
import pygltflib
import pytest
import trimesh
from PIL import Image

from jobs.cli import main
from reports.exports import maps
from weaves.colour import encoded
from weaves.fabric import load_fabric

SIZE = 64


def call(*tokens):
    return main(["export", *tokens])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return the maps of an open cloth that lets light through."""
    made = tmp_path_factory.mktemp("maps") / "gauze"
    assert call("gauze", "--maps", str(made), "--size", str(SIZE)) == 0
    return made


@pytest.fixture(scope="module")
def about(folder):
    return json.loads((folder / "maps.json").read_text(encoding="utf-8"))


def test_every_map_is_there_in_every_size(folder, about):
    assert about["texels"] == [SIZE, SIZE] and about["yarns"] == [2, 2]
    assert about["mip_levels"] == [[SIZE >> k, SIZE >> k] for k in range(1, 7)]
    places = {(SIZE, SIZE): folder} | {(w, h): folder / "mips" / f"{w}x{h}" for w, h in about["mip_levels"]}
    for (width, height), place in places.items():
        names = set(about["maps"]) - ({"yarn_id"} if place != folder else set())
        assert {path.stem for path in place.glob("*.exr")} == {path.stem for path in place.glob("*.png")} == names
        for name in names:
            values = exr(place, name)
            assert values.shape[:2] == png(place, name).shape[:2] == (height, width) and np.isfinite(values).all()


def exr(folder, name):
    with OpenEXR.File(str(folder / f"{name}.exr")) as file:
        (channel,) = file.channels().values()
        return np.array(channel.pixels, np.float64)


def png(folder, name):
    with Image.open(folder / f"{name}.png") as picture:
        return np.asarray(picture).astype(float)


def test_both_files_of_a_map_hold_the_same(folder, about):
    for name, row in about["maps"].items():
        values, codes = exr(folder, name), png(folder, name)
        if row["kind"] == "number":
            np.testing.assert_array_equal(values, codes)
        elif row["kind"] == "height":
            unit, low, high = (about["height"][key] for key in ("exr_unit_m", "png_black_m", "png_white_m"))
            assert unit == pytest.approx(0.01 * np.prod(about["yarns_per_cm"]) ** -0.5)
            np.testing.assert_allclose(low + codes / 65535 * (high - low), unit * values, atol=2e-5 * unit)
        elif row["kind"] == "colour":
            np.testing.assert_allclose(codes / 255, encoded(values), atol=0.004)
        else:
            np.testing.assert_allclose(codes / 255, values, atol=0.003)


def test_normals_are_slopes_of_the_height_and_both_conventions_differ_in_green_alone(folder, about):
    """Green up means: where the height rises towards the top of the picture, green is below a half."""
    up, down = exr(folder, "normal_opengl"), exr(folder, "normal_directx")
    np.testing.assert_allclose(up[..., [0, 2]], down[..., [0, 2]])
    np.testing.assert_allclose(up[..., 1] + down[..., 1], 1.0, atol=1e-3)
    height, normal = exr(folder, "height"), 2.0 * up - 1.0
    solid = exr(folder, "opacity") == 1.0
    inside = solid & np.roll(solid, 1, 0) & np.roll(solid, -1, 0) & (normal[..., 2] > 0.5)
    per_row = about["yarns"][1] / SIZE
    towards_top = (np.roll(height, 1, 0) - np.roll(height, -1, 0)) / (2 * per_row)
    slope = -normal[..., 1] / normal[..., 2]
    assert np.median(np.abs(towards_top - slope)[inside]) < 0.05


def test_sizes_are_stated_and_changed_files_kept(about, tmp_path, capsys):
    assert about["yarns_per_cm"] == [20.0, 20.0] and about["yarns_per_cm_source"] == "default"
    assert about["size_cm"] == [0.1, 0.1]
    fabric = load_fabric("voile").model_copy(update={"yarns_per_cm": (18.0, 16.0)})
    (tmp_path / "draft.toml").write_text(fabric.to_toml(), encoding="utf-8")
    own = (str(tmp_path / "draft.toml"), "--maps", str(tmp_path / "own"), "--size", "64")
    assert call(*own) == 0
    assert "assumed" not in capsys.readouterr().out
    found = json.loads((tmp_path / "own" / "maps.json").read_text(encoding="utf-8"))
    assert found["yarns_per_cm"] == [18.0, 16.0] and found["yarns_per_cm_source"] == "fabric"
    assert found["size_cm"] == pytest.approx([found["yarns"][0] / 18.0, found["yarns"][1] / 16.0])
    (tmp_path / "own" / "opacity.png").write_bytes(b"painted over")
    assert call(*own) == 2 and "opacity.png: was changed" in capsys.readouterr().err


def test_packed_maps_hold_the_single_ones(folder):
    occlusion, orm, mask = (exr(folder, name) for name in ("occlusion", "orm", "mask"))
    rough = (exr(folder, "roughness_along") * exr(folder, "roughness_across")) ** 0.5
    none = np.zeros_like(occlusion)
    np.testing.assert_allclose(orm, np.stack([occlusion, rough, none], axis=-1), atol=1e-3)
    np.testing.assert_allclose(mask, np.stack([none, occlusion, none, 1.0 - rough], axis=-1), atol=1e-3)
    solid = exr(folder, "opacity") == 1.0
    assert occlusion[solid].min() < 0.5 and occlusion[solid].max() > 0.95
    assert (occlusion[exr(folder, "opacity") == 0] == 1).all()


def test_the_document_is_valid_and_its_thin_walled_material_sends_light_back_and_through(folder):
    """OpenPBR 1.1.2: base and subsurface share the light by its weight; of the latter (1 + g) / 2 goes through.

    In MaterialX 1.39.5 the node is that of 1.1.1, which takes the subsurface colour twice: docs/blender.md says so."""
    library, document = MaterialX.createDocument(), MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath(), library)
    assert library.getNodeDef("ND_open_pbr_surface_surfaceshader").getVersionString() == "1.1.1"
    MaterialX.readFromXmlFile(document, str(folder / "material.mtlx"))
    document.setDataLibrary(library)
    valid, reason = document.validate()
    assert valid, reason
    (shader,) = document.getNodes("open_pbr_surface")
    inputs = {given.getName() for given in shader.getInputs()}
    assert {"base_color", "specular_roughness_anisotropy", "geometry_opacity", "subsurface_weight"} <= inputs
    files = [node.getInput("file").getValueString() for node in document.getNodes("tiledimage")]
    assert len(files) >= 8 and all((folder / name).is_file() for name in files)
    weight, g = (shader.getInputValue(f"subsurface_{name}") for name in ("weight", "scatter_anisotropy"))

    def colour(key):
        node = shader.getInput(key).getConnectedNode()
        name = node.getInput("in1").getConnectedNode().getInput("file").getValueString()
        return exr(folder, name.removesuffix(".exr")) / node.getInputValue("in2")

    base, scattered = colour("base_color"), colour("subsurface_color")
    assert shader.getInputValue("geometry_thin_walled") and max(base.max(), scattered.max()) < 1.002
    back = (1.0 - weight) * base + weight * (1.0 - g) / 2.0 * scattered
    through = weight * (1.0 + g) / 2.0 * scattered
    np.testing.assert_allclose(back, exr(folder, "base_color"), rtol=1e-5)
    np.testing.assert_allclose(through, exr(folder, "transmission_color"), rtol=1e-5)
    # As near to 1 as can be: programs of 1.1.1, which square it, err least.
    assert scattered.max() > 0.99


def test_the_sample_is_read_by_other_libraries(folder):
    document = pygltflib.GLTF2().load(str(folder / "sample.glb"))
    (material,) = document.materials
    extensions = {f"KHR_materials_{name}" for name in ("anisotropy", "ior", "sheen", "specular")}
    assert set(material.extensions) == set(document.extensionsUsed) == extensions
    assert material.alphaMode == "BLEND" and material.doubleSided and len(document.images) == 5
    mesh = trimesh.load(folder / "sample.glb", force="mesh", process=False)
    assert len(mesh.faces) == 2 * 24 * 2048
    # A cone of slant 1.6, in units of 80 yarns of half a millimetre.
    low, high = mesh.bounds
    assert 0.03 < high[1] - low[1] < 0.08 and high[1] < 0.0
    lengths = np.linalg.norm(mesh.visual.uv[mesh.edges[:, 0]] - mesh.visual.uv[mesh.edges[:, 1]], axis=-1)
    # A map shows a millimetre: texture coordinates are millimetres, and no yarn is stretched.
    np.testing.assert_allclose(lengths / 1000.0, mesh.edges_unique_length[mesh.edges_unique_inverse], rtol=0.05)


@pytest.mark.parametrize("library", ["MaterialX", "pygltflib"])
def test_a_missing_library_is_named_with_the_command_that_installs_it(tmp_path, monkeypatch, capsys, library):
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(maps, "find_spec", lambda name: None if name == library else True)
    assert call("denim", "--maps", str(tmp_path / "a")) == 2
    said = capsys.readouterr().err
    assert library in said and "pip install 'twillight[materials]'" in said
