"""A material of texture maps: what a program that knows no yarns shows of a fabric.

The maps are those of `twillight export --maps` (pipeline.materials), for unit colours: red is the warp's, green the
weft's, so that one evaluation gives the four components. pipeline.materials.lookup reads and
evaluates them. The method ignores that yarns hide one another, and that the mean of a product is not the
product of the means.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, Field

from pipeline.models.analytic.adapter import Analytic, AnalyticOptions
from pipeline.per_fabric import PerFabric
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.materials.lookup import MaterialMaps


def _power_of_two(size: int) -> int:
    """Check that mip levels of this size are exact."""
    if size & (size - 1):
        raise ValueError("must be a power of two")
    return size


class MapMaterialOptions(AnalyticOptions):
    """Texture maps of base colour, normal, tangent, specular colour and two roughnesses; nothing is trained."""

    seconds: ClassVar[tuple[float, float]] = (0.0, 4e-7)
    prepare_seconds: ClassVar[float] = 1.8
    kinds: ClassVar[frozenset[str]] = frozenset({"behind", "stretch"})
    """Light from behind, and footprints of any shape by taps along their longer axis."""

    model: Literal["map_material"] = "map_material"
    size: Annotated[int, AfterValidator(_power_of_two)] = Field(default=512, ge=64, le=4096)
    """Texels of the longer side of the maps, a power of two."""
    specular: float = Field(default=0.3, gt=0, le=1)
    """Specular colour of the yarns in terms that are not linear in it: what highlights take from the diffuse light."""
    sheen: bool = True
    """True for a material with a sheen, as that of glTF."""

    def methods(self) -> list[Analytic[MaterialMaps]]:
        """Return the one method; its bytes are those of all levels at 8 bits a number, as programs store them."""
        from pipeline.materials.lookup import TEXEL_CHANNELS, answer

        def stored(tables: MaterialMaps) -> int:
            return len(tables.maps.texels) * (TEXEL_CHANNELS + self.parallax)

        tables = PerFabric(lambda fabric: _tables(fabric, self))
        return [Analytic(self, None, tables, lambda tables, queries, _: answer(tables, queries), stored)]


def _tables(fabric: Fabric, options: MapMaterialOptions) -> MaterialMaps:
    """Return the maps of a fabric in unit colours."""
    from pipeline.analytic.parallax_mapping import height_maps
    from pipeline.materials.lobes import reflectance
    from pipeline.materials.lookup import tabulate
    from pipeline.materials.planes import layout, planes
    from pipeline.materials.textures import constants

    share, sheen = reflectance(fabric), np.zeros(4)
    if options.sheen:
        # What a white cloth lacks at grazing views goes to the components that have light there.
        grazing = np.concatenate([options.specular * share.grazing_specular, share.grazing_diffuse])
        white = _painted(fabric, options.specular, warp=(1.0, 1.0, 1.0), weft=(1.0, 1.0, 1.0))
        sheen = constants(white, share).sheen[0] * grazing / grazing.sum()
    painted = _painted(fabric, options.specular, warp=(1.0, 0.0, 0.0), weft=(0.0, 1.0, 0.0))
    chosen = layout(painted, options.size)
    finest = planes(painted, chosen, share)
    heights = height_maps(fabric, finest.height.astype(np.float64), (chosen.ends, chosen.picks), options.parallax)
    return tabulate(finest, constants(painted, share), chosen, sheen, options.specular, heights)


def _painted(fabric: Fabric, specular: float, **colours: tuple[float, float, float]) -> Fabric:
    """Return the fabric with all ends of one colour and all picks of one; `specular` scales their highlights."""
    yarns = {}
    for name, colour in colours.items():
        glossy = tuple(specular * channel for channel in colour)
        every = {"diffuse": colour, "diffuse_transmission": colour, "specular": glossy}
        yarns[name] = getattr(fabric, name).model_copy(update=every)
    return fabric.model_copy(update=yarns | {"colours": None})
