"""`selvage`: a wished error or time, and the cheapest answer that keeps it; its options."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from pipeline.models.analytic.adapter import AnalyticOptions
from pipeline.models.selvage.wish import USUAL_ERROR, text_of
from pipeline.truth.options import Walls

if TYPE_CHECKING:
    from pipeline.models.selvage.model import Selvage

_WishedError = Annotated[float, Field(gt=0, lt=1)]


class SelvageOptions(AnalyticOptions):
    """Soft nodes of the level that each query needs for a wished error, or the fallback; nothing is trained."""

    parameter: ClassVar[str] = "errors"
    usual_setting: ClassVar[float] = USUAL_ERROR
    settings_allowed: ClassVar[str] = "a relative error above 0 and below 1 after the colon is needed, such as :.02"
    turns: ClassVar[bool] = True
    kinds: ClassVar[frozenset[str]] = frozenset({"stretch", "behind", "curvature"})
    seconds: ClassVar[tuple[float, float]] = (0.0, 1e-6)
    prepare_seconds: ClassVar[float] = 4.0

    model: Literal["selvage"] = "selvage"
    errors: list[_WishedError] = Field(default=[0.1, 0.05, 0.02, 0.01], min_length=1, max_length=16)
    """Wished relative errors of a grey cloth's colour; each is a row of the tables."""
    parallax: Literal[True] = True
    """Footprints are patches of view rays."""
    walls: Walls = "rim"
    """Meaning of a view ray that meets a wall; must be that of the truth."""

    @property
    def work(self) -> float:
        """Work of all settings: an error of .1 takes that of one soft node level, smaller ones more."""
        return sum(0.1 / error for error in self.errors)

    @classmethod
    def read_setting(cls, text: str) -> float:
        """Return the wished error that a text names."""
        if not 0.0 < float(text) < 1.0:
            raise ValueError(text)
        return float(text)

    @classmethod
    def setting_of(cls, setting: float) -> str:
        """Return the text of a wished error."""
        return text_of(setting)

    def methods(self) -> list[Selvage]:
        """Return one method for each wished error."""
        from pipeline.models.selvage.model import Selvage

        return [Selvage(error, self.name, self.walls) for error in self.errors]
