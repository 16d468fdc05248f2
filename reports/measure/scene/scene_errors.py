"""Measurements of a method on a scene: errors of its picture, aliasing along the camera path, time of a frame.

Errors are those of the first frame (`reports.measure.scene.image_error`), over the pixels of lit cloth; the colour's is
over the queries of all frames. Flicker and excess energy are those of `reports.measure.aliasing` over all frames:
flicker where cloth is lit in every one of them, the spectrum of whole frames, whose background is the truth's.
Intervals are those of `reports.measure.block_bootstrap`, over blocks of pixels with all their frames; excess energy has
none. Every method is wrapped by `pipeline.models.fallback`; its fallback share stands beside its
numbers.

FovVideoVDP [Mantiuk2021FovVideoVDP] is the visibility of the difference of two films in JOD: 10 where they look the
same, one less where 3 of 4 people prefer the truth. Sustained and transient contrast count, so flicker does. Films are
luminance on a display: Y = peak min(max(exposure L, 0), 1) + peak / contrast. Frames are fewer than
the quarter of a second that the metric looks back: the first one is taken to have stood still before. `pyfvvdp` may
not be used commercially and is therefore no dependency.
"""

import math
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, Final

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.models.fallback import Fallback
from pipeline.models.method import Method
from reports.error import COLOUR_WEIGHTS, squared_error
from reports.images.exr import frame_layers
from reports.measure.aliasing import excess_energy, flicker, temporal_variances
from reports.measure.block_bootstrap import block_interval
from reports.measure.pictures import write_picture
from reports.measure.scene.image_error import image_errors, noise_floor
from reports.measure.scene.shot import Shot
from reports.measure.timing import Contender, affordable, time_side_by_side, timed
from reports.options import ImageOptions, RepeatOptions, SceneErrorOptions
from reports.record import TRUTH, Record
from weaves.colour import EXPOSURE, LUMINANCE

_LONGEST: Final = 0.01  # seconds of a timed call
_FEWEST: Final = 128  # queries about a cloth in such a call: its fixed cost must not count as the cost of queries
_PEAK: Final = 200.0  # of the display that FovVideoVDP looks at, in candela per square metre


def write_truth(shot: Shot, path: Path) -> None:
    """Write the truth's frames and the standard error of the first as an OpenEXR."""
    pictures, whole = shot.pictures(), np.ones(shot.base.shape[1:3], np.bool_)
    about = {"scene": shot.name, "method": TRUTH}
    write_picture(path, pictures[0], whole, about, shot.noise()[0], frame_layers(pictures))


def measure_scene(
    methods: Sequence[Fallback], shot: Shot, options: SceneErrorOptions, pictures: Mapping[str, Path]
) -> list[Record]:
    """Measure the settings of a method on a scene; those that do not cover every cloth are left out.

    The options are those of the comparison, and the seed of random methods. `pictures` says where the frames of which
    setting are written, as an OpenEXR: the first as the picture, the others and the maps of its differences from the
    truth as layers (`reports.images.exr`).
    """
    image, truths, noises, lit = options.image, shot.pictures(), shot.noise(), shot.lit
    floor, records = noise_floor(truths[0], noises[0], lit[0], image), []
    for method in filter(shot.covered_by, methods):
        answers = shot.answers(method, options.seed)
        shown = shot.pictures(answers)
        subject = _subject(method, shot)
        measured, maps = image_errors(subject, shown[0], truths[0], noises[0], lit[0], image, floor)
        if method.setting in pictures:
            about = {"scene": shot.name, "method": method.name, "setting": method.setting}
            layers = frame_layers(shown) | maps
            write_picture(pictures[method.setting], shown[0], np.ones_like(lit[0]), about, layers=layers)
        records += [*measured, _colour(subject, shot, answers, image)]
        own, truth, noise = (values @ np.array(LUMINANCE) for values in (shown, truths, noises))
        records += _over_time(subject, own, truth, noise, np.asarray(lit.all(axis=0)), image)
        if (rims := shot.rim_errors(method, options.seed)).size:
            records.append(subject.of("rim_coverage", float(np.sqrt(np.square(rims).mean())), rims.size))
        outside = [method.out_of_domain(cloth.fabric, cloth.queries) for cloth in shot.cloths]
        records.append(subject.of("fallback_share", float(np.concatenate(outside).mean()), sum(map(len, outside))))
    return records


def _over_time(
    subject: Record, own: Float64, truth: Float64, noise: Float64, still: Mask, image: ImageOptions
) -> list[Record]:
    """Return the aliasing of a method's luminance, and FovVideoVDP's score; `still` shows lit cloth all the way."""
    if len(own) == 1:
        return []
    records: list[Record] = []
    if still.any():
        value = flicker(own[:, still], truth[:, still], noise[:, still])
        scale = truth[:, still].mean() ** 2
        rows = (temporal_variances(own[:, still]) - temporal_variances(truth[:, still], noise[:, still])) / scale
        _, low, high = block_interval(rows, still, image)
        records.append(subject.of("flicker", value, len(own), low=low, high=high))
    records.append(subject.of("excess_energy", excess_energy(own, truth, noise), len(own)))
    return records + fovvideovdp(subject, own, truth)


def time_scene(methods: Sequence[Fallback], shot: Shot, options: RepeatOptions, seed: int) -> list[Record]:
    """Time the first frame by all methods that cover its cloths, in turns on one thread, in milliseconds.

    Each cloth is timed on as many of its queries as one call can answer in `_LONGEST`, at least `_FEWEST`. The time of
    all its queries is in proportion, so that a small cloth with slow queries gets its true weight.
    """
    if not (able := [method for method in methods if shot.covered_by(method)]):
        return []
    mixed = np.random.default_rng(seed)
    contenders = []
    # In a random order, so that the first ones are a fair sample of the frame.
    first = [(cloth.fabric, np.flatnonzero(cloth.frame == 0), cloth.queries) for cloth in shot.cloths]
    subjects = [(fabric, queries.take(rows[mixed.permutation(len(rows))])) for fabric, rows, queries in first]
    for method in able:
        for fabric, queries in subjects:
            method.prepare(fabric)
            # Quadrature's own preparation must not look like the time of a query: rare ones come late in a call.
            rare = np.flatnonzero(method.out_of_domain(fabric, queries))[:1]
            method.predict(fabric, queries.take(rare))
            contenders.append(affordable(Contender(method.predict, [(fabric, queries)]), _LONGEST, _FEWEST))
    timings = time_side_by_side(contenders, options.timing_repeats, options.warm_up)
    readings = np.array([timing.samples for timing in timings]).reshape(len(able), len(subjects), -1)
    counts = np.array([len(queries.u) for _, queries in subjects])
    frames = (1e-6 * np.einsum("mct,c->mt", readings, counts)).tolist()
    return [timed(_subject(method, shot), "frame_time", own) for method, own in zip(able, frames, strict=True)]


def _colour(subject: Record, shot: Shot, answers: Sequence[Float32], image: ImageOptions) -> Record:
    """Return the relative RMSE of the colour measure over the queries of all frames."""
    of_cloths = answers, [cloth.mean for cloth in shot.cloths], [cloth.standard_error for cloth in shot.cloths]
    values, truth, noise = (np.concatenate(parts).astype(np.float64) for parts in of_cloths)
    own, reference = values @ COLOUR_WEIGHTS, truth @ COLOUR_WEIGHTS
    spread = np.sqrt(np.square(noise) @ np.square(COLOUR_WEIGHTS))
    error = squared_error(own, reference, spread, resamples=0)
    # The mean over queries is the sum over pixels over their number; all queries of a pixel are drawn together.
    pixel, size = np.concatenate([cloth.pixel for cloth in shot.cloths]), shot.base.shape[1:3]
    squares = (np.square(own - reference) - np.square(spread))[:, 0]
    count, sums = (np.bincount(pixel, weights, minlength=size[0] * size[1]) for weights in (None, squares))
    lit = (count > 0).reshape(size)
    rows = sums[lit.ravel()] * lit.sum() / len(pixel)
    _, *ends = block_interval(rows, lit, image)
    low, high = (math.sqrt(max(end, 0.0)) / error.mean for end in ends)
    return subject.of("colour_rrmse", error.relative_rmse, error.count, low=low, high=high)


def _subject(method: Method, shot: Shot) -> Record:
    return Record(method=method.name, setting=method.setting, scene=shot.name, threads=1)


def fovvideovdp(subject: Record, film: Float64, truth: Float64) -> list[Record]:
    """Return the quality of a film in JOD as a Record; nothing where pyfvvdp is not installed.

    Film and truth are linear luminance (F, H, W), irradiance included (as in `reports.measure.pictures`).
    """
    try:
        library: Any = import_module("pyfvvdp")
    except ImportError:
        return []
    metric = library.fvvdp(
        display_photometry=library.fvvdp_display_photo_eotf(_PEAK, contrast=1000.0, EOTF="linear"),
        display_geometry=library.fvvdp_display_geometry((3840, 2160), distance_m=0.7472, diagonal_size_inches=30.0),
        device="cpu",
        quiet=True,
    )
    light = [(_PEAK * np.clip(EXPOSURE * frames, 0.0, 1.0)).astype(np.float32) for frames in (film, truth)]
    score = float(metric.predict(*light, dim_order="FHW", frames_per_second=30.0)[0])
    return [subject.of("fovvideovdp", score, len(film))]
