"""The PLY file, read back by a reader of its own, and the sentences for what cannot be exported."""

import re

import numpy as np

from jobs.cli import main
from weaves.fabric import load_fabric
from weaves.mesh import repeat_mesh

FLOAT, BYTE = "<f4", "u1"


def read_ply(path):
    """Return places, colours and triangles of a binary PLY with float places, byte colours and triangles."""
    content = path.read_bytes()
    header, body = content.split(b"end_header\n", 1)
    lines = header.decode("ascii").split("\n")
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    count = {line.split()[1]: int(line.split()[2]) for line in lines if line.startswith("element")}
    properties = [line for line in lines if line.startswith("property")]
    assert properties[:3] == [f"property float {axis}" for axis in "xyz"]
    assert properties[3:7] == [f"property uchar {name}" for name in ("red", "green", "blue", "alpha")]
    assert properties[7].startswith("property list uchar int") and len(properties) == 8
    vertex = np.dtype([("place", FLOAT, 3), ("colour", BYTE, 4)])
    face = np.dtype([("corners", BYTE), ("index", "<i4", 3)])
    vertices = np.frombuffer(body, vertex, count["vertex"])
    faces = np.frombuffer(body[vertices.nbytes :], face)
    assert len(faces) == count["face"] and (faces["corners"] == 3).all()
    return vertices["place"], vertices["colour"], faces["index"]


def test_the_file_holds_the_mesh_in_the_colours_of_its_yarns(twillight, tmp_path):
    code, text, complaint = twillight(
        "export", "denim", "--mesh", "deep/cloth.ply", "--vertices", "6", "--repeats", "2"
    )
    assert (code, complaint) == (0, "") and "deep/cloth.ply" in text
    places, colours, faces = read_ply(tmp_path / "deep" / "cloth.ply")
    meshes = repeat_mesh(load_fabric("denim"), 6, (2, 2))
    assert f"{len(faces):,} triangles" in text
    start_vertex, start_face = 0, 0
    for mesh, linear in zip(meshes, (*_diffuse("denim"), None), strict=True):
        vertices = slice(start_vertex, start_vertex + len(mesh.vertices))
        np.testing.assert_array_equal(places[vertices], mesh.vertices.astype(np.float32))
        np.testing.assert_array_equal(faces[start_face : start_face + len(mesh.faces)] - start_vertex, mesh.faces)
        shown = np.unique(colours[vertices], axis=0)
        assert len(shown) == 1 and shown[0, 3] == 255
        if linear is not None:
            np.testing.assert_allclose(shown[0, :3], _srgb(linear), atol=0.6)
        else:
            assert (shown[0, :3] < 64).all()
        start_vertex, start_face = vertices.stop, start_face + len(mesh.faces)
    assert start_vertex == len(places) and start_face == len(faces)
    # Nothing but the file is left, and the same command writes the same bytes.
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["cloth.ply"]
    first = (tmp_path / "deep" / "cloth.ply").read_bytes()
    twillight("export", "denim", "--mesh", "deep/cloth.ply", "--vertices", "6", "--repeats", "2")
    assert (tmp_path / "deep" / "cloth.ply").read_bytes() == first


def _diffuse(name):
    fabric = load_fabric(name)
    return fabric.warp.diffuse_rgb, fabric.weft.diffuse_rgb


def _srgb(linear):
    """Encode as IEC 61966-2-1 does, in 8 bits."""
    linear = np.asarray(linear)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_help_lists_export_after_show(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["--help"]) == 0
    verbs = re.findall(r"^│ (\S+)", capsys.readouterr().out, re.M)  # a long help goes on below, after more spaces
    assert verbs[verbs.index("export") - 1] == "show"
