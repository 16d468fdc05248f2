"""The live page of a fabric: cloth that the reader turns, in the browser, with pictures of the truth."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from jobs.plan.dataset import SECONDS_A_POINT
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.task import Coloured, Progress
from pipeline import versions

_TABLES_SECONDS, _POINTS_A_PIXEL, _VIEWS = 60.0, 2048, 5
_TABLES_BYTES, _BYTES_A_PIXEL = 4_000_000, 100


class LivePage(Measurement):
    """The live page of a fabric. The page of the recipe shows it; it has no Records."""

    kind: Literal["live page"] = "live page"
    fabric: Coloured
    """The fabric."""
    pixels: int
    """Along each side of the pictures of the truth and of other methods."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one for each fabric that the recipe lists."""
        chosen = subjects.recipe.bench.live
        for subject in subjects.fabrics:
            if subject.fabric.name in chosen.fabrics:
                yield cls(fabric=subject.fabric, pixels=chosen.pixels)

    @property
    def group(self) -> str:
        """Live pages."""
        return "live pages"

    @property
    def title(self) -> str:
        """Fabric."""
        return f"live page of {self.fabric.name}"

    @property
    def name(self) -> str:
        """Beginning of the name of its file."""
        return f"live-{self.fabric.name}"

    @property
    def records(self) -> str:
        """No Records."""
        return ""

    @property
    def products(self) -> tuple[str, ...]:
        """The page."""
        return (f"{self.stem}.html",)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return _TABLES_SECONDS + _VIEWS * self.pixels**2 * _POINTS_A_PIXEL * SECONDS_A_POINT

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return _TABLES_BYTES + _BYTES_A_PIXEL * self.pixels**2

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth, of the models that it shows, and of the page."""
        shown = ("soft_nodes", "selvage", "map_material")
        return {"truth": versions.TRUTH, "viewer": versions.VIEWER} | {
            name: versions.MODELS.get(name, 1) for name in shown
        }

    def run(self, out: Path, progress: Progress) -> None:
        """Write it."""
        from reports.viewer.view import write_page

        write_page(self.fabric, out / self.products[0], self.pixels)
