"""Cloths and files of a scene, read without Mitsuba."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from pipeline.scenes.scene import PREFIX, Scene


def worn(scene: Scene) -> dict[str, str]:
    """Return what names the fabric, a preset or a path, of every cloth of a scene by its key.

    A dictionary's cloths are those that the scene describes; an XML file's also those whose BSDF ids it holds.
    """
    found = dict.fromkeys(key.removeprefix(PREFIX) for key in _ids(scene) if key.startswith(PREFIX))
    return {key: (scene.cloths[key].fabric if key in scene.cloths else "") or key for key in (*scene.cloths, *found)}


def files(scene: Scene) -> list[Path]:
    """Return the file of a scene and those it refers to, such as meshes and textures, if they are there."""
    if not isinstance(scene.source, Path):
        return []
    folder = scene.source.parent
    named = [folder / value for element in _elements(scene) for value in _filenames(element)]
    return [scene.source, *sorted({path for path in named if path.is_file()})]


def _ids(scene: Scene) -> list[str]:
    return [element.get("id", "") for element in _elements(scene) if element.tag == "bsdf"]


def _filenames(element: ElementTree.Element) -> list[str]:
    own = [element.get("filename", "")] if element.tag == "include" else []
    return own + ([element.get("value", "")] if element.get("name") == "filename" else [])


def _elements(scene: Scene) -> list[ElementTree.Element]:
    """Return all elements of a scene's XML; none of what is no XML, which Mitsuba will say."""
    if not isinstance(scene.source, Path):
        return []
    try:
        return list(ElementTree.parse(scene.source).iter())
    except (ElementTree.ParseError, OSError):
        return []
