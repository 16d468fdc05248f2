"""The kinds of measurement, in the order in which a plan lists their tasks: each after those it reads."""

from __future__ import annotations

from typing import Final

from jobs.plan.measurements.added_metric import OfAddedMetric
from jobs.plan.measurements.errors_by_size import ErrorsBySize
from jobs.plan.measurements.extremes import Extremes
from jobs.plan.measurements.frame_time import FrameTime
from jobs.plan.measurements.images.truth_edge import TruthEdge
from jobs.plan.measurements.images.truth_frames import TruthFrames
from jobs.plan.measurements.images.truth_picture import TruthPicture
from jobs.plan.measurements.latents import Latents
from jobs.plan.measurements.live_page import LivePage
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.method import OnFabric
from jobs.plan.measurements.scene import OnScene
from jobs.plan.measurements.scene_shot import SceneShot
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.measurements.timing import Timing
from jobs.plan.measurements.truth import Truth
from jobs.plan.measurements.unseen_population import OnUnseenPopulation

KINDS: Final[tuple[type[Measurement], ...]] = (
    TruthPicture,
    TruthFrames,
    TruthEdge,
    Truth,
    OnFabric,
    OnUnseenPopulation,
    Latents,
    SceneShot,
    OnScene,
    FrameTime,
    Extremes,
    Timing,
    ErrorsBySize,
    OfAddedMetric,
    LivePage,
)


def measurements(subjects: Subjects) -> list[Measurement]:
    """Return all measurements of a recipe."""
    return [task for kind in KINDS for task in kind.planned(subjects)]
