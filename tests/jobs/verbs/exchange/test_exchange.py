import re

import numpy as np
import trimesh

from pipeline.shader import tables
from reports.viewer import view
from tests.reports.viewer.conftest import shown_of
from tests.weaves.draft_files.drafts import numbered, wif
from weaves.fabric import load_fabric
from weaves.mesh import repeat_mesh


def test_a_draft_becomes_a_fabric_that_other_verbs_load_with_numbers_of_single_yarns_replaced(twillight, tmp_path):
    (tmp_path / "draft.wif").write_text(wif(WARP_COLORS=numbered([1, 2] * 4)), encoding="utf-8")
    code, text, complaint = twillight("import", "draft.wif", "--out", "deep/Scarf #2.toml", "--like", "denim")
    assert (code, complaint) == (0, "")
    assert "it repeats after 4 ends and 4 picks" in text and "Assumed:" in text and "bend 12° and 38°" in text
    fabric = load_fabric(tmp_path / "deep" / "Scarf #2.toml")
    assert fabric.name == "Scarf_2" and fabric.warp.bend == load_fabric("denim").warp.bend
    code, text, _ = twillight("show", "deep/Scarf #2.toml")
    assert code == 0 and "4 ends × 4 picks" in text
    (tmp_path / "a.wif").write_text(wif(), encoding="utf-8")
    options = ["--warp.bend", "7", "--weft.width", "0.6", "--weft.roughness", "0.2", "--name", "own"]
    assert twillight("import", "a.wif", "--out", "a.toml", *options)[0] == 0
    fabric = load_fabric(tmp_path / "a.toml")
    like = load_fabric("cotton_twill")
    assert (fabric.name, fabric.warp.bend, fabric.weft.width, fabric.weft.roughness) == ("own", 7, 0.6, 0.2)
    assert (fabric.weft.bend, fabric.warp.roughness) == (like.weft.bend, like.warp.roughness)


def test_a_part_of_a_draft_is_a_fabric(twillight, refused, tmp_path):
    """Ends 3 to 6 of a twill, two white and two red, and picks 2 to 5."""
    (tmp_path / "a.wif").write_text(wif(WARP_COLORS=numbered([1, 1, 1, 1, 2, 2, 1, 1])), encoding="utf-8")
    code, text, _ = twillight("import", "a.wif", "--out", "a.toml", "--ends", "3-6", "--picks", "2-5")
    assert code == 0 and "4 ends and 4 picks" in text
    fabric = load_fabric(tmp_path / "a.toml")
    assert fabric.weave.rows() == ["..##", ".##.", "##..", "#..#"]
    assert [count for _, count in fabric.colours.ends] == [2, 2]
    for part in ("3", "0-4", "5-4", "1-9", "a-b"):
        complaint = refused("import", "a.wif", "--out", "b.toml", "--ends", part)
        assert f"--ends = '{part}': first and last thread are needed, such as 1-8" in complaint


def test_a_fabric_that_was_exported_is_imported(twillight, tmp_path):
    code, text, _ = twillight("export", "herringbone", "--wif", "h.wif")
    assert code == 0 and "h.wif" in text and "no spacing" in text
    assert twillight("import", "h.wif", "--out", "h.toml", "--like", "herringbone")[0] == 0
    first, again = load_fabric("herringbone"), load_fabric(tmp_path / "h.toml")
    assert again.weave == first.weave and again.optics() == first.optics()


def read_ply(path):
    assert path.read_bytes().startswith(b"ply\nformat binary_little_endian 1.0\n")
    mesh = trimesh.load(path, process=False)
    return mesh.vertices.astype(np.float32), mesh.visual.vertex_colors, mesh.faces


def test_the_file_holds_the_mesh_in_the_colours_of_its_yarns(twillight, tmp_path):
    command = "export", "denim", "--mesh", "deep/cloth.ply", "--vertices", "6", "--repeats", "2"
    code, text, complaint = twillight(*command)
    assert (code, complaint) == (0, "") and "deep/cloth.ply" in text
    places, colours, faces = read_ply(tmp_path / "deep" / "cloth.ply")
    denim = load_fabric("denim")
    meshes = repeat_mesh(denim, 6, (2, 2))
    assert f"{len(faces):,} triangles" in text
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    np.testing.assert_array_equal(places, np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float32))
    np.testing.assert_array_equal(faces, np.concatenate([m.faces + n for m, n in zip(meshes, starts, strict=False)]))
    warp, weft, core = (np.unique(part, axis=0) for part in np.split(colours, starts[1:-1]))
    assert (warp[:, 3] == 255).all() and len(warp) == len(weft) == len(core) == 1 and (core[0, :3] < 64).all()
    np.testing.assert_allclose(warp[0, :3], _srgb(denim.warp.diffuse_rgb), atol=0.6)
    np.testing.assert_allclose(weft[0, :3], _srgb(denim.weft.diffuse_rgb), atol=0.6)
    # Nothing but the file is left, and the same command writes the same bytes.
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["cloth.ply"]
    first = (tmp_path / "deep" / "cloth.ply").read_bytes()
    twillight(*command)
    assert (tmp_path / "deep" / "cloth.ply").read_bytes() == first


def test_every_end_and_pick_has_its_own_colour(twillight, tmp_path):
    """Four dark and four light threads on a weave of four: a mesh of one repeat has not all of them, and says so."""
    for repeats, shown in ((1, 1), (3, 2)):
        code, text, _ = twillight("export", "houndstooth", "--mesh", "c.ply", "--vertices", "4", "--repeats", repeats)
        assert code == 0 and ("part of a pattern that repeats after 2 repeats" in text) == (repeats == 1)
        places, colours, faces = read_ply(tmp_path / "c.ply")
        threads = load_fabric("houndstooth").thread_colours()
        for axis, mesh in enumerate(repeat_mesh(load_fabric("houndstooth"), 4, (repeats, repeats))[:2]):
            count = len(mesh.vertices)
            inside = np.abs(mesh.vertices[:, axis] - np.rint(mesh.vertices[:, axis])) > 1e-3
            thread = np.floor(places[:count, axis]).astype(int) % 8
            np.testing.assert_allclose(
                colours[:count, :3][inside], _srgb(threads[axis].diffuse[thread])[inside], atol=0.6
            )
            own, faces = faces[: len(mesh.faces)], faces[len(mesh.faces) :] - count
            assert (np.ptp(colours[:count][own].astype(int), axis=1) == 0).all()
            assert len(np.unique(colours[:count], axis=0)) == shown
            places, colours = places[count:], colours[count:]


def test_a_shader_of_yarns_has_the_weave_and_the_colours_of_all_threads(twillight, tmp_path):
    code, text, _ = twillight("export", "houndstooth", "--osl", "a.osl")
    assert code == 0 and "8 ends × 8 picks" in text
    source = (tmp_path / "a.osl").read_text(encoding="utf-8")
    (top,) = re.findall(r"int top\[16\] = \{(.*)\},", source)
    fabric = load_fabric("houndstooth")
    assert (np.array(top.split(", ")) == "0").tolist() == fabric.weave.warp_over.ravel().tolist()
    for thread, threads in zip(("end", "pick"), fabric.thread_colours(), strict=True):
        (rows,) = re.findall(rf"color {thread}_diffuse\[8\] = \{{color(.*)\}},", source)
        shown = np.array([row.strip("()").split(", ") for row in rows.split(", color")], float)
        np.testing.assert_allclose(shown / shown.max(), threads.diffuse / threads.diffuse.max(), rtol=1e-6)


def _srgb(linear):
    """Encode as IEC 61966-2-1 does, in 8 bits."""
    linear = np.asarray(linear)
    return 255 * np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)


def test_a_page_of_a_fabric_is_written_whole_and_one_of_a_large_repeat_refused_before_any_work(
    twillight, refused, monkeypatch, tmp_path
):
    found = shown_of(0, (2,), (1.0,), 32)
    with monkeypatch.context() as patch:
        patch.setattr(tables, "MOST_REPEAT_CELLS", 3)
        patch.setattr(view, "content", None)
        assert "at most 3 cells" in refused("view", "gingham", "--out", "x.html") and not list(tmp_path.iterdir())
    monkeypatch.setattr(view, "content", lambda fabric, truth, progress: progress(1.0) or found)
    code, said, _ = twillight("view", "gingham", "--out", "a/x.html")
    assert code == 0 and "5 views" in said and [path.name for path in (tmp_path / "a").iterdir()] == ["x.html"]
