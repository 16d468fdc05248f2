"""Properties of the BSDF `twillight`."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from pipeline.models.patch_bsdf import USUAL
from pipeline.scenes.scene import Cloth, Yarns


class ClothOptions(BaseModel):
    """Cloth of a shape, the method that evaluates it, and the size of its footprints."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    fabric: str
    """A preset, or the path of a fabric's TOML."""
    method: str = USUAL
    """The method that evaluates the cloth: a model that comes with the package or learns nothing, with ``:k`` for a
    setting; the folder of a trained model; or ``truth``."""
    yarns: Yarns = 100.0
    """Yarn spacings in one unit of u and of v."""
    yarns_v: Yarns | None = None
    """Yarn spacings in one unit of v, if they differ from those of u."""
    turn: float = Field(default=0.0, ge=-360, le=360)
    """Angle from u to the weft, in degrees, as the front shows it."""
    sigma: float | None = Field(default=None, gt=0, le=1e6)
    """Standard deviation of every footprint, in yarn spacings, whatever the ray; left out: from the ray."""
    pixel_angle: float | None = Field(default=None, gt=0, le=1)
    """Angle of a pixel as the camera sees it, in radians: the footprint of a ray that has no differentials. It is too
    small after a bounce."""

    @property
    def cloth(self) -> Cloth:
        """The cloth, as scenes describe it."""
        return Cloth(fabric=self.fabric, yarns=(self.yarns, self.yarns_v or self.yarns), turn=self.turn)
