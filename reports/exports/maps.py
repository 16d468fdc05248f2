"""A folder of texture maps with mip levels as EXR and PNG, their size in `maps.json`, and materials made of them."""

import json
from collections.abc import Callable
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.mip_levels import halved
from pipeline.folders import own_files
from pipeline.materials.lobes import SHEEN_ROUGHNESS, reflectance
from pipeline.materials.occlusion import lit_coverage
from pipeline.materials.planes import Layout, layout, planes, yarn_ids
from pipeline.materials.textures import Textures, across_direction, constants, openpbr_roughness, textures
from reports.exports import materials
from reports.exports.materials import DOCUMENT, SAMPLE, spacing_cm, yarns_per_cm
from reports.images.texture import Kind, write_texture
from weaves.errors import BadInput
from weaves.fabric import Fabric

LISTING: Final = "maps.json"

Plane = npt.NDArray[Any]


class Map(NamedTuple):
    """How a map is stored (`reports.images.texture`), its content, and how it follows from those of a level."""

    kind: Kind
    meaning: str
    of: Callable[[Textures], Plane] | None = None
    """None: it is one of the textures, of the same name."""


def _rotation(level: Textures) -> Plane:
    """Return the angle from +U to the direction across the fibres, in turns."""
    x, y = np.moveaxis(across_direction(level.normal, level.tangent), -1, 0)
    return np.asarray(np.mod(np.arctan2(y, x) / (2.0 * np.pi), 0.5))


def _openpbr(level: Textures) -> tuple[Plane, Plane]:
    return openpbr_roughness(level.alpha_along, level.alpha_across)


def _isotropic(level: Textures) -> Plane:
    """Return the roughness of a round highlight as bright as the long one at its middle."""
    return np.asarray((level.alpha_along * level.alpha_across) ** 0.25)


def _orm(level: Textures) -> Plane:
    return np.stack([level.occlusion, _isotropic(level), np.zeros_like(level.occlusion)], axis=-1)


def _mask(level: Textures) -> Plane:
    none = np.zeros_like(level.occlusion)
    return np.stack([none, level.occlusion, none, 1.0 - _isotropic(level)], axis=-1)


_DOWN: Final = np.array([1.0, -1.0, 1.0], np.float32)

MAPS: Final[dict[str, Map]] = {
    "base_color": Map("colour", "diffuse colour, not multiplied by the opacity"),
    "specular_color": Map("colour", "tint of the specular lobe; F0 is that of `ior` times it"),
    "transmission_color": Map("colour", "colour of the light that goes diffusely through"),
    "opacity": Map("share", "0 in gaps between yarns, 1 on yarns"),
    "height": Map("height", "height in yarn spacings; gaps at the lowest point"),
    "normal_opengl": Map("direction", "normal, green up (OpenGL, +Y)", lambda level: level.normal),
    "normal_directx": Map("direction", "normal, green down (DirectX, -Y)", lambda level: level.normal * _DOWN),
    "tangent": Map("direction", "direction of the fibres, green up"),
    "anisotropy_rotation": Map(
        "share", "direction across the fibres: angle from +U towards +V, in turns; do not filter", _rotation
    ),
    "roughness_along": Map(
        "share", "roughness along the fibres, the square root of alpha", lambda level: np.sqrt(level.alpha_along)
    ),
    "roughness_across": Map(
        "share", "roughness across the fibres, the square root of alpha", lambda level: np.sqrt(level.alpha_across)
    ),
    "roughness": Map("share", "roughness of OpenPBR; goes with anisotropy", lambda level: _openpbr(level)[0]),
    "anisotropy": Map("share", "anisotropy of OpenPBR, rougher across", lambda level: _openpbr(level)[1]),
    "occlusion": Map("share", "ambient occlusion: the share of an even sky's light that arrives"),
    "orm": Map(
        "share", "red occlusion, green roughness without anisotropy, blue metallic, which is 0 (glTF, Unreal)", _orm
    ),
    "mask": Map("share", "red metallic, green occlusion, blue detail, alpha smoothness: 1 - roughness (Unity)", _mask),
}
"""Every map that has mip levels, by its file name; `transmission_color` is left out where nothing goes through."""

YARN_ID: Final = Map("number", "0 in gaps, then ends from the left, then picks from below; do not filter")
"""The numbers of the yarns (`pipeline.materials.planes.yarn_ids`), without mip levels."""


def write_maps(fabric: Fabric, folder: Path, size: int = 2048) -> str:
    """Write the maps of a fabric, whole or not at all, and return a sentence on them.

    Maps of before are replaced (`pipeline.folders`); `size` counts the texels of the longer side. BadInput if the size,
    the folder or a missing library allows no maps.
    """
    for library in ("MaterialX", "pygltflib"):
        if find_spec(library) is None:
            raise BadInput("export", "maps", str(folder), f"{library} is needed: pip install 'twillight[materials]'")
    shown = layout(fabric, size)
    with own_files(folder, LISTING) as made:
        count = _write(fabric, shown, made)
    ends, picks = yarns_per_cm(fabric)
    assumed = "" if fabric.yarns_per_cm else ", assumed because the fabric has no yarns_per_cm"
    return (
        f"{folder}: {count} maps of {shown.width} × {shown.height} texels as EXR and PNG, {SAMPLE} and "
        f"{DOCUMENT}; a map shows {shown.ends} ends × {shown.picks} picks, {shown.ends / ends:.3g} × "
        f"{shown.picks / picks:.3g} cm (yarns per cm: {ends:g} × {picks:g}{assumed})"
    )


def _write(fabric: Fabric, shown: Layout, folder: Path) -> int:
    """Write all files, and return the number of maps."""
    share = reflectance(fabric)
    material, level, lit = constants(fabric, share), planes(fabric, shown, share), lit_coverage(fabric, shown)
    maps = {name: row for name, row in MAPS.items() if name != "transmission_color" or material.transmitted > 0.0}
    span = (float(level.height.min()), float(level.height.max()))
    write_texture(folder / "yarn_id", yarn_ids(fabric, shown), YARN_ID.kind)
    levels: list[tuple[int, int]] = []
    sampled, place = False, folder
    while True:
        level_maps = textures(level, material, lit)
        for name, row in maps.items():
            plane = row.of(level_maps) if row.of else getattr(level_maps, name)
            write_texture(place / name, plane, row.kind, span)
        if not sampled and max(level.coverage.shape) <= materials.LARGEST_TEXTURE:
            materials.write_sample(folder / SAMPLE, fabric, shown, level_maps, material)
            sampled = True
        if level.coverage.size == 1:
            break
        level, lit = level.halved(), halved(lit)
        height, width = level.coverage.shape
        levels.append((width, height))
        (place := folder / "mips" / f"{width}x{height}").mkdir(parents=True)
    maps["yarn_id"] = YARN_ID
    materials.write_openpbr(folder / DOCUMENT, fabric.name, material)
    ends, picks = yarns_per_cm(fabric)
    about = {
        "fabric": fabric.name,
        "generator": f"twillight {version('twillight')}",
        "yarns": (shown.ends, shown.picks),
        "texels": (shown.width, shown.height),
        "yarns_per_cm": (ends, picks),
        "yarns_per_cm_source": "fabric" if fabric.yarns_per_cm else "default",
        "size_cm": (shown.ends / ends, shown.picks / picks),
        "openpbr": materials.OPENPBR,
        "orientation": "U along the picks, V along the ends; the lower left corner is the first end and pick",
        "material": {
            "ior": material.ior,
            "sheen_color": [round(float(value), 6) for value in material.sheen],
            "sheen_roughness": SHEEN_ROUGHNESS,
            "transmitted": material.transmitted,
        },
        "height": {
            "zero": "the middle plane of the cloth, where the axes of yarns change side",
            "exr_unit_m": spacing_cm(fabric) / 100.0,
            "png_black_m": span[0] * spacing_cm(fabric) / 100.0,
            "png_white_m": span[1] * spacing_cm(fabric) / 100.0,
        },
        "maps": {
            name: {"meaning": row.meaning, "kind": row.kind, "exr": f"{name}.exr", "png": f"{name}.png"}
            for name, row in maps.items()
        },
        "mip_levels": levels,
    }
    (folder / LISTING).write_text(json.dumps(about), encoding="utf-8")
    return len(maps)
