"""The folder that `twillight export --maps` writes: maps with mip levels, their size, and materials made of them."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Final

from jobs.verbs.exchange.maps.about import FILE as ABOUT
from jobs.verbs.exchange.maps.about import AboutMaps, about
from jobs.verbs.exchange.maps.catalogue import MAPS, YARN_ID, Map
from jobs.verbs.exchange.maps.openpbr import FILE as DOCUMENT
from jobs.verbs.exchange.maps.openpbr import write_openpbr
from jobs.verbs.exchange.maps.sample import FILE as SAMPLE
from jobs.verbs.exchange.maps.sample import LARGEST_TEXTURE, write_sample
from pipeline.folders import own_files
from pipeline.materials.layout import layout
from pipeline.materials.planes import planes, yarn_ids
from pipeline.materials.reflectance import reflectance
from pipeline.materials.textures import Textures, constants, textures
from reports.images.texture import write_texture
from weaves.errors import BadInput
from weaves.fabric import Fabric

SIZE: Final = 2048
"""Texels of the longer side, if no other number is given."""


def export_maps(fabric: Fabric, folder: Path, size: int) -> str:
    """Write the maps of a fabric, whole or not at all, and return a sentence on them.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    folder : Path
        Folder to write; maps of before are replaced (`pipeline.folders`).
    size : int
        Texels of the longer side.

    Raises
    ------
    BadInput
        If the size, the folder or a missing library allows no maps.
    """
    for library, package in (("MaterialX", "MaterialX"), ("pygltflib", "pygltflib")):
        if find_spec(library) is None:
            allowed = f"{package} is needed for materials: pip install 'twillight[materials]'"
            raise BadInput("export", "--maps", str(folder), allowed)
    found = layout(fabric, size)
    with own_files(folder, ABOUT) as made:
        written = _write(fabric, size, made)
    assumed = "" if fabric.yarns_per_cm else ", assumed because the fabric has no yarns_per_cm"
    width, height = written.size_cm
    return (
        f"{folder}: {len(written.maps)} maps of {found.width} × {found.height} texels as EXR and PNG, {SAMPLE} and "
        f"{DOCUMENT}; a map shows {found.ends} ends × {found.picks} picks, {width:.3g} × {height:.3g} cm"
        f" (yarns per cm: {written.yarns_per_cm[0]:g} × {written.yarns_per_cm[1]:g}{assumed})"
    )


def _write(fabric: Fabric, size: int, folder: Path) -> AboutMaps:
    """Write all files."""
    found, share = layout(fabric, size), reflectance(fabric)
    material, level = constants(fabric, share), planes(fabric, found, share)
    maps = {name: row for name, row in MAPS.items() if name != "transmission_color" or material.transmitted > 0.0}
    span = (float(level.height.min()), float(level.height.max()))
    write_texture(folder / "yarn_id", yarn_ids(fabric, found), YARN_ID[0])
    levels, sampled = [], False
    place = folder
    while True:
        level_maps = textures(level, material)
        _write_level(place, level_maps, maps, span)
        if not sampled and max(level.coverage.shape) <= LARGEST_TEXTURE:
            write_sample(folder / SAMPLE, fabric, found, level_maps, material)
            sampled = True
        if level.coverage.size == 1:
            break
        level = level.halved()
        height, width = level.coverage.shape
        levels.append((width, height))
        (place := folder / "mips" / f"{width}x{height}").mkdir(parents=True)
    listed = {**{name: (row.kind, row.meaning) for name, row in maps.items()}, "yarn_id": YARN_ID}
    write_openpbr(folder / DOCUMENT, fabric.name, material)
    said = about(fabric, found, material, span, listed, levels)
    (folder / ABOUT).write_text(said.model_dump_json(indent=2) + "\n", encoding="utf-8")
    return said


def _write_level(folder: Path, level: Textures, maps: dict[str, Map], span: tuple[float, float]) -> None:
    """Write the maps of one level."""
    for name, row in maps.items():
        write_texture(folder / name, row.of(level), row.kind, span)
