"""Cloths and files of a scene, read without Mitsuba.

Mitsuba itself ends without a sentence where elements are nested some ten thousand deep, or a face names a vertex that
is not there, and waits for ever for a pipe that a scene names as a file. So a scene is checked before Mitsuba reads it:
its XML (`elements`), and its triangles in PLY and in Mitsuba's own format (`refuse_lost_vertices`).
"""

import math
import struct
import zlib
from pathlib import Path
from typing import Any, Final, NamedTuple
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64
from pipeline.scenes.scene import PREFIX, Scene
from weaves.errors import BadInput, one_line
from weaves.reading import MIB, read_text, refuse_irregular

_MOST_DEPTH: Final = 32  # elements inside one another
_MOST_BYTES: Final = 16 * MIB
_MOST_ELEMENTS: Final = 200_000
_MOST_INCLUDED: Final = 64
_LARGEST: Final = 3.4e38  # of single precision
_NO_NUMBERS: Final = {"string", "ref", "boolean", "include", "alias"}
_MOST_UNPACKED: Final = 1 << 30  # bytes

Corners = npt.NDArray[np.integer[Any]]


class Element(NamedTuple):
    """An element of a scene's XML."""

    tag: str
    attributes: dict[str, str]

    def filename(self) -> str:
        """Return the file that it names; empty if none."""
        if "filename" in self.attributes:
            return self.attributes["filename"]
        return self.attributes.get("value", "") if self.attributes.get("name") == "filename" else ""


def worn(scene: Scene) -> dict[str, str]:
    """Return what names the fabric, a preset or a path, of every cloth of a scene by its key.

    A dictionary's cloths are those that the scene describes; an XML file's also those whose BSDF ids it holds.
    """
    ids = [element.attributes.get("id", "") for element in elements(scene) if element.tag == "bsdf"]
    keys = [*scene.cloths, *(name.removeprefix(PREFIX) for name in ids if name.startswith(PREFIX))]
    return {key: (scene.cloths[key].fabric if key in scene.cloths else "") or key for key in keys}


def files(scene: Scene) -> list[Path]:
    """Return the file of a scene and those it refers to, such as meshes and textures, if they are there."""
    if not isinstance(scene.source, Path):
        return []
    folder = scene.source.parent
    named = [folder / name for element in elements(scene) if (name := element.filename())]
    return [scene.source, *sorted({path for path in named if path.is_file()})]


def elements(scene: Scene) -> list[Element]:
    """Return the elements of a scene's XML and of the files that it includes; none of a scene that is no file.

    BadInput if a file is no XML, too large, nested more deeply than `_MOST_DEPTH`, of too many elements, has a document
    type or an element `path`, or names a file by a parameter or one that is no regular file.
    """
    if not isinstance(scene.source, Path):
        return []
    found: list[Element] = []
    left, home = [scene.source], scene.source.parent
    for path in left:
        inside = _parsed(path)
        for element in inside:
            _refuse(element, path, home)
        found += inside
        included = {home / element.filename() for element in inside if element.tag == "include"}
        left += sorted(name for name in included if name.is_file() and name not in left)
        if len(left) > _MOST_INCLUDED:
            raise BadInput(str(scene.source), "include", len(left), f"at most {_MOST_INCLUDED} files may be included")
    return found


def _parsed(path: Path) -> list[Element]:
    """Return the elements of one file."""
    found: list[Element] = []
    where, depth = str(path), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > _MOST_DEPTH:
            raise BadInput(where, "", "nested too deeply", f"at most {_MOST_DEPTH} levels are allowed")
        if len(found) == _MOST_ELEMENTS:
            raise BadInput(where, "", "too many elements", f"at most {_MOST_ELEMENTS:,} are allowed")
        found.append(Element(tag, attributes))

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1

    def doctype(*_: object) -> None:
        raise BadInput(where, "", "has a document type", "leave the line <!DOCTYPE …> out")

    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler, parser.EndElementHandler, parser.StartDoctypeDeclHandler = start, end, doctype
    try:
        parser.Parse(read_text(path, _MOST_BYTES, "a Mitsuba XML"), True)
    except FileNotFoundError as error:
        raise BadInput(where, "", "does not exist", "a Mitsuba XML is needed") from error
    except expat.ExpatError as error:
        reason = f"broken XML ({one_line(error)})"
        raise BadInput(where, "", reason, "a Mitsuba 3 scene that loads is needed") from error
    return found


def _refuse(element: Element, path: Path, home: Path) -> None:
    """Refuse an element that names files in a way that cannot be checked, or names one that is no regular file."""
    where, name = str(path), element.filename()
    _refuse_numbers(element, where)
    if element.tag == "path":
        folder = element.attributes.get("value", "")
        raise BadInput(where, "path", folder, "leave it out, and name files beside the scene")
    if "$" in name or "$" in element.attributes.get("name", ""):
        raise BadInput(where, "filename", name, "names of files and of properties are written out, without parameters")
    for place in {home, path.parent} if name else ():
        refuse_irregular(place / name, f"a file, which the scene {path.name} names,")


def _refuse_numbers(element: Element, where: str) -> None:
    """Refuse numbers that single precision does not hold, and a scale or matrix that makes a shape flat.

    Mitsuba takes them, and shows a black or an odd picture.
    """
    of = element.attributes
    name = of.get("name", "")
    for key, text in of.items() if element.tag not in _NO_NUMBERS else ():
        numbers = _numbers(text) if key not in ("name", "id", "type") else np.empty(0)
        if not (np.abs(numbers) <= _LARGEST).all():
            allowed = "finite numbers of single precision are needed"
            raise BadInput(where, f"{element.tag} {name}".rstrip(), text, allowed)
        if element.tag == "scale" and (numbers == 0).any():
            raise BadInput(where, f"scale {key}", text, "must not be 0")
    if element.tag == "matrix" and (matrix := _numbers(of.get("value", ""))).size in (9, 16):
        side = math.isqrt(matrix.size)
        if np.linalg.matrix_rank(matrix.reshape(side, side)[:3, :3]) < 3:
            raise BadInput(where, "matrix", of["value"], "must have an inverse")


def _numbers(text: str) -> Float64:
    """Return the numbers of an attribute; none if it holds anything else."""
    try:
        return np.array(text.replace(",", " ").split(), np.float64)
    except ValueError:
        return np.empty(0)


def refuse_lost_vertices(path: Path) -> None:
    """Refuse a mesh with a face of a vertex that is not there; what is no such mesh is left to Mitsuba."""
    with path.open("rb") as file:
        read = {b"ply": _ply, b"\x1c\x04\x03": _serialized, b"\x1c\x04\x04": _serialized}.get(file.read(3))
    if read is None:
        return
    try:
        corners, vertices = read(path)
    except Exception:  # whatever readers raise; Mitsuba has a sentence for it
        return
    wrong = corners[(corners < 0) | (corners >= vertices)]
    if wrong.size:
        raise BadInput(str(path), "vertex of a face", int(wrong[0]), f"the mesh has {vertices:,}, counted from 0")


def _ply(path: Path) -> tuple[Corners, int]:
    """Return the corners of the faces of a PLY file, and its number of vertices."""
    import trimesh  # takes a second

    mesh = trimesh.load_mesh(path, process=False)
    return np.asarray(mesh.faces), len(mesh.vertices)


def _serialized(path: Path) -> tuple[Corners, int]:
    """Return the corners of the first mesh of a file in Mitsuba's format, and its number of vertices."""
    packed = path.read_bytes()
    _, version = struct.unpack_from("<HH", packed)
    data = zlib.decompressobj().decompress(packed[4:], _MOST_UNPACKED)
    flags, start = *struct.unpack_from("<I", data), 4
    start = data.index(b"\0", start) + 1 if version == 4 else start
    vertices, faces = struct.unpack_from("<QQ", data, start)
    columns = 3 + 3 * bool(flags & 0x1) + 2 * bool(flags & 0x2) + 3 * bool(flags & 0x8)
    start += 16 + vertices * columns * (8 if flags & 0x2000 else 4)
    return np.frombuffer(data, "<u4", 3 * faces, start), vertices
