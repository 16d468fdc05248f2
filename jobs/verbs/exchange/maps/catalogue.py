"""The maps of a folder: names, kinds and meanings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.materials.textures import Textures, across_direction, openpbr_roughness
from reports.images.texture import Kind

Plane = npt.NDArray[Any]


class Map(NamedTuple):
    """One map.

    Attributes
    ----------
    kind : str
        How it is stored; see `reports.images.texture`.
    meaning : str
        Its content.
    of : callable
        Returns it from the textures of a level.
    """

    kind: Kind
    meaning: str
    of: Callable[[Textures], Plane]


def _rotation(level: Textures) -> Plane:
    """Return the angle from +U to the direction across the fibres, in turns."""
    x, y = np.moveaxis(across_direction(level.normal, level.tangent), -1, 0)
    return np.asarray(np.mod(np.arctan2(y, x) / (2.0 * np.pi), 0.5))


def _openpbr(level: Textures) -> tuple[Plane, Plane]:
    return openpbr_roughness(level.alpha_along, level.alpha_across)


_DOWN: Final = np.array([1.0, -1.0, 1.0], np.float32)

MAPS: Final[dict[str, Map]] = {
    "base_color": Map("colour", "diffuse colour, not multiplied by the opacity", lambda level: level.base_color),
    "specular_color": Map(
        "colour", "tint of the specular lobe; F0 is that of `ior` times it", lambda level: level.specular_color
    ),
    "transmission_color": Map(
        "colour", "colour of the light that goes diffusely through", lambda level: level.transmission_color
    ),
    "opacity": Map("share", "0 in gaps between yarns, 1 on yarns", lambda level: level.opacity),
    "height": Map("height", "height in yarn spacings; gaps at the lowest point", lambda level: level.height),
    "normal_opengl": Map("direction", "normal, green up (OpenGL, +Y)", lambda level: level.normal),
    "normal_directx": Map("direction", "normal, green down (DirectX, -Y)", lambda level: level.normal * _DOWN),
    "tangent": Map("direction", "direction of the fibres, green up", lambda level: level.tangent),
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
}
"""Every map that has mip levels, by its file name; `transmission_color` is left out where nothing goes through."""

YARN_ID: Final[tuple[Kind, str]] = (
    "number",
    "0 in gaps, then ends from the left, then picks from below; do not filter",
)
"""Kind and meaning of the numbers of the yarns (`pipeline.materials.planes.yarn_ids`); without mip levels."""
