"""Error and time of path-traced frames in Mitsuba: soft nodes against one random point a sample.

Frames of shipped scenes by the integrator `twillight_path`; everything but the method is the same. Error is the
mean squared error of linear RGB over the frame against frames that the ground truth renders, over the squared
mean of these. There are two such frames r, s with different random numbers: (x - r)(x - s) has the squared error of x
as its mean, whatever the noise of r and s is. Time is the processor's, of all threads.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Final

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.scenes.variant import LLVM_MISSING, llvm_works
from reports.truth.row_records import RowRecords
from weaves.errors import WorkFailed

OURS: Final = "soft_nodes:2"  # the method whose gain is stated
OTHER: Final = "point_sampled:1"  # one random point a sample

SAMPLES: Final[dict[str, tuple[int, ...]]] = {OURS: (1, 4, 16), OTHER: (1, 2, 4, 8, 16, 32, 64)}
"""Samples a pixel of each method."""


@dataclass(frozen=True)
class Traced:
    """One method in one scene with one number of samples."""

    method: str
    fabric: str  # the scene
    samples: str  # a pixel; text, as it is part of the setting
    error: Annotated[float, "traced_error"]
    seconds: Annotated[float, "traced_time"]  # of a processor for a frame
    count: int  # frames
    gain: Annotated[float, "traced_gain"] = math.nan
    """Error of one point a sample in equal time over this error; NaN for one point a sample itself, and unknown."""


RECORDS: Final = RowRecords(Traced, setting=("samples",), method_field="method")


def measure(
    scenes: Sequence[str] = ("plane", "sphere", "drape"),
    size: int = 64,
    samples: Mapping[str, Sequence[int]] = SAMPLES,
    reference: tuple[str, int] = ("truth", 16),
    frames: int = 4,
) -> Iterator[Traced]:
    """Measure every method in every scene; error and time are means over frames with different random numbers.

    `size` is the side of a frame in pixels. `samples` has numbers of samples a pixel by method, the last one `OTHER`;
    `reference` is the method of the reference frames, and its samples. WorkFailed without LLVM, which would take hours.
    """
    if not llvm_works():
        raise WorkFailed(f"path_traced: {LLVM_MISSING}")
    for name in scenes:
        truths = [_frames(name, reference[0], size)(reference[1], 1000 + k)[0] for k in range(2)]
        scale = float(np.mean(truths)) ** 2
        rows: list[Traced] = []
        for method, counts in reversed(list(samples.items())):
            frame_of = _frames(name, method, size)
            frame_of(1, 0)  # loads and tabulates
            for count in counts:
                made = [frame_of(count, seed) for seed in range(1, frames + 1)]
                errors = [float(np.mean((frame - truths[0]) * (frame - truths[1]))) / scale for frame, _ in made]
                error, seconds = float(np.mean(errors)), float(np.median([seconds for _, seconds in made]))
                others = [row for row in rows if row.method == OTHER]
                gain = _error_in(seconds, others) / error if method != OTHER and error > 0 else math.nan
                rows.append(Traced(method, name, str(count), error, seconds, frames, gain))
        yield from rows


def _frames(name: str, method: str, size: int) -> Callable[[int, int], tuple[Float64, float]]:
    """Return a function of samples a pixel and a seed: the frame (size, size, 3), and the processor's seconds."""
    from pipeline.mitsuba.register import dress, register  # Mitsuba, which tables of Records need not wait for

    loaded = load(load_scene(name), SceneOptions())
    world, mi = dress(loaded, method), register()
    film = {"type": "hdrfilm", "width": size, "height": size, "component_format": "float32", "rfilter": {"type": "box"}}
    view = mi.ScalarTransform4f(loaded.camera.to_world)
    sensor = mi.load_dict({"type": "perspective", **loaded.camera.settings, "to_world": view, "film": film})
    integrator = mi.load_dict({"type": "twillight_path", "max_depth": 4})

    def frame(samples: int, seed: int) -> tuple[Float64, float]:
        begun = time.process_time()
        picture: Any = mi.render(world, sensor=sensor, integrator=integrator, spp=samples, seed=seed)
        pixels = np.asarray(picture, np.float64)[..., :3]
        return pixels, time.process_time() - begun

    return frame


def _error_in(seconds: float, found: Sequence[Traced]) -> float:
    """Return the error in a time, by a power law between two numbers of samples.

    In less time than the fewest samples take, it is the error of these; in more than the most take, NaN: it is unknown.
    """
    times, errors = np.log(sorted((row.seconds, row.error) for row in found if row.error > 0)).T
    return float(np.exp(np.interp(math.log(seconds), times, errors, right=math.nan)))
