"""Image of the truth, in one file that other measurements read."""

from __future__ import annotations

from jobs.plan.dataset import SECONDS_A_POINT, points_a_row
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.task import Coloured, Made
from pipeline import versions
from pipeline.truth.options import TruthOptions

_BYTES_A_PIXEL = 28


class TruthImage(Measurement):
    """An image of the truth of one fabric. Every recipe and every model shares it. Each kind says what it shows."""

    fabric: Coloured
    """The fabric."""

    @property
    def shows(self) -> str:
        """Content of the image, for people and for the name of its file."""
        raise NotImplementedError

    @property
    def pixels(self) -> int:
        """Number of its pixels."""
        raise NotImplementedError

    @property
    def estimator(self) -> TruthOptions:
        """Options of the truth that it is rendered with."""
        raise NotImplementedError

    @property
    def group(self) -> str:
        """The truth's pictures."""
        return "truth of the pictures"

    @property
    def title(self) -> str:
        """Fabric and what it shows."""
        return f"truth of {self.fabric.name}, {self.shows}"

    @property
    def name(self) -> str:
        """Beginning of the name of its file."""
        return f"truth-{self.fabric.name}-{self.shows}"

    @property
    def records(self) -> str:
        """No Records."""
        return ""

    @property
    def products(self) -> tuple[str, ...]:
        """The image."""
        return (f"{self.stem}.exr",)

    @property
    def made(self) -> Made:
        """The image, as other measurements read it."""
        return Made(task=self.id, path=self.products[0])

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return self.pixels * SECONDS_A_POINT * points_a_row(self.estimator)

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return self.pixels * _BYTES_A_PIXEL

    def versions(self) -> dict[str, int]:
        """Return the versions of the truth and of the benchmark."""
        return {"truth": versions.TRUTH, "bench": versions.BENCH}
