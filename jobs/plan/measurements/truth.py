"""The truth itself on one fabric: its noise on held-out queries, the motion in its frames."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jobs.plan.measurements.images.truth_frames import TruthFrames
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import Dataset, Subjects
from jobs.plan.task import Coloured, Made, Progress
from pipeline import versions
from reports.options import ErrorOptions, FrameOptions, Role, select

if TYPE_CHECKING:
    from reports.record import Record


class Truth(Measurement):
    """The truth's noise on a fabric's held-out queries, and the motion in its frames."""

    kind: Literal["truth"] = "truth"
    fabric: Coloured
    """The fabric."""
    role: Role
    """Role of the fabric."""
    dataset: Dataset
    """Held-out queries of the fabric."""
    errors: ErrorOptions
    """Number of these queries."""
    frames: Made
    """The truth's frames."""
    frame_options: FrameOptions
    """Options of the frames."""

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a fabric."""
        bench = subjects.recipe.bench
        for subject in subjects.fabrics:
            yield cls(
                fabric=subject.fabric,
                role=subject.role,
                dataset=subject.dataset,
                errors=select(ErrorOptions, bench),
                frames=TruthFrames.of(subject.fabric, subjects.recipe).made,
                frame_options=select(FrameOptions, bench),
            )

    @property
    def group(self) -> str:
        """The truth."""
        return "truth"

    @property
    def title(self) -> str:
        """Fabric."""
        return f"truth on {self.fabric.name}"

    @property
    def name(self) -> str:
        """Beginning of the names of its files."""
        return f"truth-{self.fabric.name}"

    @property
    def needs(self) -> tuple[str, ...]:
        """Test rows and frames."""
        return (*self.dataset.rows, self.frames.task)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return 0.3

    @property
    def size(self) -> int:
        """Estimated bytes."""
        return 4000

    def versions(self) -> dict[str, int]:
        """Return the version of the benchmark; that of the truth is in its inputs."""
        return {"bench": versions.BENCH}

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure it."""
        from pipeline.shards.manifest import Manifest
        from reports.measure.frames import measure_truth_frames
        from reports.measure.held_out import measure_truth
        from reports.record import Provenance

        folder, provenance = out / self.dataset.folder, Provenance(dataset=self.dataset.fingerprint)
        manifest = Manifest.load(folder)
        records = measure_truth(manifest, folder, self.fabric.name, self.role, self.errors, provenance)
        frames = out / self.frames.path
        return records + measure_truth_frames(self.fabric, self.role, self.frame_options, frames, provenance)
