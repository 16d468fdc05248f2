"""Caveats of a page: limits of its numbers, and measurements that are missing with the reason."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from pipeline.scenes.options import ViewOptions
from reports.images.tiles import DIFFERENCE_RANGE, EXPOSURE
from reports.options import BenchOptions
from reports.record import Record
from reports.tables.headline import BOUNDED
from reports.tables.number_format import display, listed
from reports.tables.summary import of_baseline, rows


def caveats(options: BenchOptions, per_material: Sequence[str], errors: pd.DataFrame) -> list[str]:
    """Return the limits of the numbers that every page names."""
    view = options.view
    notes = [
        "The conditions of the published table (data set, ranges, training, footprints) are not known. The ratios here "
        "are the paper's comparison repeated on this project's own ground truth, not a reproduction of its numbers.",
        "The truth is that of the model: yarns as bent, twisted cylinders, one layer of fibres scattering once, plus a "
        "diffuse lobe; reflection only. It is not a measurement of real cloth.",
        "Times are those of this machine and of code called from Python, a batch of queries at a time; the paper's are "
        "of a GPU renderer. Compare only ratios within one column.",
        *_trainings(errors),
        *_unseen(errors),
        *_bounded(errors),
        _footprint_note(view),
        f"Pictures are shown alike: linear values times {EXPOSURE}, cut at 1, sRGB encoding. Their MSE is over the lit "
        f"pixels, in linear radiance under an irradiance of {view.irradiance:.3g}. Difference images show luminance, "
        f"in full colour from ±{DIFFERENCE_RANGE:.0%} of the truth's mean.",
    ]
    black = errors[of_baseline(errors) & (errors["zero_answers"] > 0)] if len(errors) else errors
    if len(black):
        share = float(black["zero_answers"].mean())
        notes.append(
            f"Point sampling at 2 points answers 0 for {share:.0%} of the queries: all its points are hidden from the "
            "viewer, and the formula gives no value there. Drawing on until a point is seen would cost time and lower "
            "its error."
        )
    if per_material:
        names = " and ".join(display(name) for name in per_material)
        notes.append(
            f"{names} is trained on every fabric by itself, so no fabric is unseen; the rows are for comparison. "
            "Random unseen fabrics, where there are any, are left out."
        )
    return notes


def _trainings(errors: pd.DataFrame) -> list[str]:
    """Return sentences on the number of trainings, if anything was trained."""
    counts: dict[str, int] = {}
    for row in rows(errors[errors["seeds"] > 0]) if len(errors) else ():
        counts[display(row.method)] = max(row.seeds, counts.get(display(row.method), 0))
    once = [name for name, count in counts.items() if count == 1]
    several = {name: count for name, count in counts.items() if count > 1}
    notes = []
    if once:
        notes.append(
            f"One training of {listed(once)}, with one seed: how much another training would differ was not measured."
        )
    if several:
        numbers = listed(sorted({str(count) for count in several.values()}))
        notes.append(
            f"Numbers of {listed(list(several))} are means over {numbers} trainings, which differ in their seed alone; "
            "brackets hold the least and the most of them. That range is no interval: another training may lie "
            "outside. Extremes are the worst of all trainings. Times, memory, errors between fabrics, pictures and "
            "other runtimes are of the first training."
        )
    return notes


def _unseen(errors: pd.DataFrame) -> list[str]:
    """Return a sentence on the number of unseen fabrics, if any fabric is unseen."""
    fabrics = max((row.fabrics for row in rows(errors) if row.role == "unseen"), default=0)
    if fabrics == 1:
        return ["One fabric is unseen: how much the errors on another would differ was not measured."]
    if fabrics:
        return [
            f"The {fabrics} unseen fabrics are a sample of the ranges of yarns in the recipe, not of the cloth that is "
            "made. Intervals over fabrics hold for that sample."
        ]
    return []


def _bounded(errors: pd.DataFrame) -> list[str]:
    """Return a sentence on the energy bound, if any network was measured under it."""
    if not len(errors) or BOUNDED not in set(errors["setting"]):
        return []
    return [
        "Bounded: no component exceeds that of the soft nodes without shadows, and what one yarn has above goes to the "
        "other yarn. The headline names this form. The bound is computed from the fabric, not learnt, and is a good "
        "answer by itself where a network does not know the fabric."
    ]


def lacking(records: Sequence[Record]) -> list[str]:
    """Return a sentence for each way of running methods that was not measured or timed, with the reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for record in records:
        if record.metric == "not_run":
            scene = f" in the scene {record.scene}" if record.scene else ""
            how = f" by {record.setting} {{}} not measured" if record.setting else f" {{}} not timed{scene}"
            reasons.setdefault((how, record.note), []).append(display(record.method))
    return [
        f"{listed(list(dict.fromkeys(methods)))}{how.format('was' if len(set(methods)) == 1 else 'were')} "
        f"({reason.rstrip('.')})."
        for (how, reason), methods in reasons.items()
    ]


def unseen_by_eye(records: Sequence[Record]) -> list[str]:
    """Return a sentence if scenes were measured without FovVideoVDP."""
    found = {record.metric for record in records}
    if "frame_time" not in found or "fovvideovdp" in found:
        return []
    return [
        "How visible the differences in the frames of a scene are was not scored by FovVideoVDP: pyfvvdp was not "
        "installed when they were measured (pip install pyfvvdp adds it; it may not be used commercially)."
    ]


def _footprint_note(view: ViewOptions) -> str:
    axis = {
        "major": "its longer axis: it blurs towards the horizon, and the truth itself does not alias",
        "geometric_mean": "the geometric mean of its axes: the truth is sharper, and shows moiré of its own",
    }[view.footprint]
    return (
        "Footprints are round, as in the papers. A pixel of the pictures is an ellipse on the cloth; the round one "
        f"takes {axis}. Views beyond {view.largest_angle:g}° to the normal are left out."
    )
