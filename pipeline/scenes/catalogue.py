"""Scenes by name: those that come with the package, a Mitsuba XML file, or a TOML file that describes one."""

import re
from pathlib import Path

from pipeline.scenes.scene import Scene
from pipeline.scenes.shipped import SHIPPED
from weaves.errors import BadInput, nearest
from weaves.validation import read_toml, validated


def load_scene(name_or_path: str | Path) -> Scene:
    """Find a scene that comes with the package by its name, or one of an XML or TOML file by its path.

    An XML file's fabrics are presets with the default number of yarns, and its camera stands still. BadInput if there
    is no such scene, or the TOML file does not describe one.
    """
    if str(name_or_path) in SHIPPED:
        return SHIPPED[str(name_or_path)]
    path = Path(name_or_path)
    if path.suffix == ".toml":
        table = read_toml(path)
        if isinstance(table.get("source"), str):
            table["source"] = path.parent / table["source"]
        scene = validated(Scene, table, str(path))
        if isinstance(scene.source, Path) and not scene.source.is_file():
            raise BadInput(str(path), "source", str(scene.source), "does not exist; a Mitsuba XML is needed")
        # Files of fabrics lie beside it, wherever it is read from.
        own = {key: cloth for key, cloth in scene.cloths.items() if cloth.fabric.endswith(".toml")}
        own = {key: cloth.model_copy(update={"fabric": str(path.parent / cloth.fabric)}) for key, cloth in own.items()}
        return scene.model_copy(update={"cloths": scene.cloths | own})
    if path.suffix == ".xml":
        if not path.is_file():
            raise BadInput("scene", "name", str(path), "does not exist; a Mitsuba XML is needed")
        return Scene(name=re.sub(r"[^A-Za-z0-9_-]", "_", path.stem)[:60], source=path)
    allowed = "a path ending in .xml or .toml, or a scene that comes with the package, is needed; "
    raise BadInput("scene", "name", str(name_or_path), allowed + nearest(str(name_or_path), SHIPPED))
