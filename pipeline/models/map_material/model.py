"""A material of texture maps: what a program that knows no yarns shows of a fabric.

The maps are those of `twillight export --maps` (pipeline.materials), for unit colours: red is the warp's, green the
weft's, so that one evaluation gives the four components. pipeline.materials.lookup reads and
evaluates them. The method ignores that yarns hide one another, and that the mean of a product is not the
product of the means.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.materials.lobes import reflectance
from pipeline.materials.lookup import TEXEL_CHANNELS, MipLevels, answer, mip_levels
from pipeline.materials.planes import layout, planes
from pipeline.materials.textures import constants
from pipeline.models.map_material.options import MapMaterialOptions
from pipeline.models.per_fabric import PerFabric
from pipeline.models.plain import refuse_other
from pipeline.truth.query import Queries
from weaves.fabric import Fabric

_Colour = tuple[float, float, float]
_RED: Final[_Colour] = (1.0, 0.0, 0.0)
_GREEN: Final[_Colour] = (0.0, 1.0, 0.0)
_WHITE: Final[_Colour] = (1.0, 1.0, 1.0)


class MapMaterial:
    """Texture maps of a fabric.

    Parameters
    ----------
    options : MapMaterialOptions
        The design.
    """

    def __init__(self, options: MapMaterialOptions) -> None:
        self.name, self.setting = options.name, ""
        self._maps = PerFabric(lambda fabric: _maps(fabric, options))

    def covers(self, fabric: Fabric) -> bool:
        """Return True: nothing is learnt."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Make the fabric's maps, once. BadInput if they are too small for its repeat."""
        self._maps.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for viewers behind and for curved cloth."""
        refuse_other(queries, self.name, stretch=True, behind=True)
        return answer(self._maps.of(fabric), queries)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of all levels at 8 bits a number, as programs store them."""
        return len(self._maps.of(fabric).texels) * TEXEL_CHANNELS


def restore(options: MapMaterialOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[MapMaterial]:
    """Return the one method."""
    return [MapMaterial(options)]


def _maps(fabric: Fabric, options: MapMaterialOptions) -> MipLevels:
    """Return the mip levels of a fabric in unit colours."""
    share, sheen = reflectance(fabric), np.zeros(4)
    if options.sheen:
        # What a white cloth lacks at grazing views goes to the components that have light there.
        grazing = np.concatenate([options.specular * share.grazing_specular, share.grazing_diffuse])
        white = _painted(fabric, options.specular, (_WHITE, _WHITE))
        sheen = constants(white, share).sheen[0] * grazing / grazing.sum()
    painted = _painted(fabric, options.specular, (_RED, _GREEN))
    found = layout(painted, options.size)
    return mip_levels(planes(painted, found, share), constants(painted, share), found, sheen, options.specular)


def _painted(fabric: Fabric, specular: float, colours: tuple[_Colour, _Colour]) -> Fabric:
    """Return the fabric with all ends of one colour and all picks of one; `specular` scales their highlights."""
    yarns = {}
    for name, colour in zip(("warp", "weft"), colours, strict=True):
        glossy = tuple(specular * channel for channel in colour)
        every = {"diffuse": colour, "diffuse_transmission": colour, "specular": glossy}
        yarns[name] = getattr(fabric, name).model_copy(update=every)
    return fabric.model_copy(update=yarns | {"colours": None})
