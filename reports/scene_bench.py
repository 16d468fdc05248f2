"""What a method makes of a scene: its picture's errors, what aliases on the camera's way, the time of a frame.

Errors are those of the first frame (`reports.image_error`), over the pixels of lit cloth. Flicker and excess energy are
those of `reports.aliasing` over all frames: flicker where cloth is lit in every one of them, the spectrum of whole
frames, whose background is the truth's. Every method is asked as `pipeline.models.fallback` says; how many questions
were not its own stands beside its numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import numpy.typing as npt

from pipeline.models.fallback import Fallback
from reports.aliasing import excess_energy, flicker
from reports.image_error import image_errors, noise_floor
from reports.metrics import COLOUR_WEIGHTS, squared_error
from reports.options import BenchOptions
from reports.pictures import write_picture
from reports.record import TRUTH, Provenance, Record
from reports.scene_frames import Shot
from reports.timing import Contender, affordable, quartiles, time_side_by_side
from weaves.colour import LUMINANCE

if TYPE_CHECKING:
    from pipeline.models.method import Method

LONGEST: Final = 0.01
"""Seconds of a timed call."""

FEWEST: Final = 128
"""Least questions about a cloth in such a call: what a call itself costs must not stand for what a question costs."""


def write_truth(shot: Shot, path: Path) -> None:
    """Write the truth's first frame and its standard error as an OpenEXR."""
    whole = np.ones(shot.base.shape[1:3], np.bool_)
    write_picture(path, shot.pictures()[0], whole, {"scene": shot.name, "method": TRUTH}, shot.noise()[0])


def measure_scene(
    methods: Sequence[Fallback],
    shot: Shot,
    options: BenchOptions,
    pictures: Mapping[str, Path],
    provenance: Provenance | None = None,
) -> list[Record]:
    """Measure the settings of a method on a scene.

    Parameters
    ----------
    methods : sequence of Fallback
        One a setting; those that do not cover every cloth are left out.
    shot : Shot
        The scene's frames.
    options : BenchOptions
        How pictures are compared, and the seed of random methods.
    pictures : mapping
        Where the first frame of which setting is written, as an OpenEXR.
    """
    truth, noise, lit = shot.pictures(), shot.noise(), shot.lit
    image = options.scenes.image
    floor = noise_floor(truth[0], noise[0], lit[0], image)
    light, still = [np.asarray(values @ np.array(LUMINANCE)) for values in (truth, noise)], lit.all(axis=0)
    records = []
    for method in (one for one in methods if shot.covered_by(one)):
        answers = shot.answers(method, options.scenes.seed)
        shown = shot.pictures(answers)
        if method.setting in pictures:
            about = {"scene": shot.name, "method": method.name, "setting": method.setting}
            write_picture(pictures[method.setting], shown[0], np.ones(lit[0].shape, np.bool_), about)
        subject = _subject(method, shot, provenance)
        records += image_errors(shown[0], truth[0], noise[0], lit[0], image, floor).records(subject)
        records.append(_colour(subject, shot, answers))
        own = np.asarray(shown @ np.array(LUMINANCE))
        strange = [method.strange(cloth.fabric, cloth.queries) for cloth in shot.cloths]
        frames = len(truth)
        records += [
            subject.of("flicker", flicker(own[:, still], light[0][:, still], 0.0, light[1][:, still]), frames),
            subject.of("excess_energy", excess_energy(own, light[0], 0.0, light[1]), frames),
            subject.of("fallback_share", float(np.concatenate(strange).mean()), sum(map(len, strange))),
        ]
    return records


def time_scene(
    methods: Sequence[Fallback], shot: Shot, options: BenchOptions, provenance: Provenance | None = None
) -> list[Record]:
    """Time the first frame by all methods that cover its cloths, in turns on one thread, in milliseconds.

    Of every cloth as many questions are asked as one call can answer in `LONGEST`, `FEWEST` at least; the time of all
    of them is in proportion, cloth by cloth: a small one with costly questions counts for no more than it is.
    """
    first = shot.first()
    if not (able := [method for method in methods if first.covered_by(method)]):
        return []
    mixed = np.random.default_rng(options.scenes.seed)
    contenders = []
    # In a random order, so that the first ones are a fair sample of the frame.
    asked = [(cloth.fabric, cloth.queries.take(mixed.permutation(len(cloth.frame)))) for cloth in first.cloths]
    for method in able:
        for fabric, queries in asked:
            method.prepare(fabric)
            # Quadrature's own preparation must not look like the time of a question: rare ones come late in a call.
            rare = np.flatnonzero(method.strange(fabric, queries))[:1]
            method.predict(fabric, queries.take(rare))
            contenders.append(affordable(Contender(method.predict, [(fabric, queries)]), LONGEST, FEWEST))
    records = []
    timings = time_side_by_side(contenders, options.timing_repeats, options.warm_up)
    readings = np.array([timing.samples for timing in timings]).reshape(len(able), len(asked), -1)
    counts = np.array([len(queries.u) for _, queries in asked])
    for method, frames in zip(able, 1e-6 * np.einsum("mct,c->mt", readings, counts), strict=True):
        samples = tuple(frames.tolist())
        low, median, high = quartiles(samples)
        subject = _subject(method, shot, provenance)
        repeats = len(samples)
        records.append(subject.of("frame_time", median, repeats, unit="ms/frame", low=low, high=high, samples=samples))
    return records


def _colour(subject: Record, shot: Shot, answers: Sequence[npt.NDArray[np.float32]]) -> Record:
    """Return the relative RMSE of the colour measure over the questions of all frames."""
    values, truth, noise = (
        np.concatenate(parts).astype(np.float64)
        for parts in (answers, [c.mean for c in shot.cloths], [c.standard_error for c in shot.cloths])
    )
    spread = np.sqrt(np.square(noise) @ np.square(COLOUR_WEIGHTS))
    error = squared_error(values @ COLOUR_WEIGHTS, truth @ COLOUR_WEIGHTS, spread, resamples=0)
    return subject.of("colour_rrmse", error.relative_rmse, error.count)


def _subject(method: Method, shot: Shot, provenance: Provenance | None) -> Record:
    return Record(
        method=method.name, setting=method.setting, scene=shot.name, threads=1, provenance=provenance or Provenance()
    )
