"""Options of `map_material`: resolution of the maps, specular colour and sheen."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import AfterValidator, Field

from pipeline.models.options import Gaussian, Name, Options


def _power_of_two(size: int) -> int:
    """Check that mip levels of this size are exact."""
    if size & (size - 1):
        raise ValueError("must be a power of two")
    return size


class MapMaterialOptions(Options):
    """Texture maps of base colour, normal, tangent, specular colour and two roughnesses; nothing is trained."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 4e-7)

    model: Literal["map_material"] = "map_material"
    """Name of its folder in `pipeline.models`."""
    footprint: Gaussian = "gaussian"
    name: Name = "map_material"
    """Name in tables."""
    size: Annotated[int, AfterValidator(_power_of_two)] = Field(default=512, ge=64, le=4096)
    """Texels of the longer side of the maps, a power of two."""
    specular: float = Field(default=0.3, gt=0, le=1)
    """Specular colour of the yarns in terms that are not linear in it: what highlights take from the diffuse light."""
    sheen: bool = True
    """True for a material with a sheen, as that of glTF."""

    @property
    def kinds(self) -> frozenset[str]:
        """Light from behind, and footprints of any shape by taps along their longer axis."""
        return frozenset({"behind", "stretch"})
