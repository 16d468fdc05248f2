"""The words of a page: its headline sentences, who is the cheapest, and what the numbers do not say.

Nothing is claimed that was not measured: a sentence is only made where both of its numbers exist.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

import pandas as pd

from pipeline.scenes.options import ViewOptions
from reports.images.tiles import DIFFERENCE_RANGE, EXPOSURE
from reports.measure.by_size import SIZES, WHOLE
from reports.options import BenchOptions
from reports.record import TRUTH, Record
from reports.tables.numbers import NO_BREAK, display, significant
from reports.tables.summary import BASELINE, PAPER, of_baseline, rows
from reports.tables.tradeoff import FLICKER_LIMITS, LIMITS, cheapest


def headline(method: str, setting: str, errors: pd.DataFrame, timing: pd.DataFrame, paper: bool = True) -> str:
    """Return the paper's sentence with our numbers, and with the paper's; empty if there is no ratio to print."""
    found = errors[(errors["method"] == method) & (errors["setting"] == setting) & errors["ratio"].notna()]
    parts = [(_comparison(row.ratio), _fabrics(row.fabrics, row.role)) for row in rows(found)]
    if not parts:
        return ""
    (first, where), *others = parts
    more = "".join(f" and {ratio} on {fabrics}" for ratio, fabrics in others)
    times = timing[(timing["method"] == method) & (timing["setting"] == setting)]["time_ratio"]
    cost = f", at {times.iloc[0]:.2g}× its time" if len(times) and math.isfinite(times.iloc[0]) else ""
    lower, faster = PAPER
    name = display(method, setting)
    said = f"{name[0].upper()}{name[1:]} reaches {first} than point sampling at 2 points on {where}{more}{cost}"
    return f"{said}; the paper reports {lower}× at {faster}× on its own scene and GPU." if paper else f"{said}."


def learnt(errors: pd.DataFrame, untrained: Collection[str] = (BASELINE[0],)) -> list[tuple[str, str]]:
    """Return the first setting of each method that is neither the truth nor among those that nothing is trained for."""
    first = errors.drop_duplicates("method")
    keys = zip(first["method"], first["setting"], strict=True)
    return [key for key in keys if key[0] not in untrained and key[0] != TRUTH]


def cheapest_sentences(table: pd.DataFrame, limits: Sequence[float] = LIMITS) -> list[str]:
    """Return for each role which method costs least within each error, from `tradeoff.tradeoff_table`.

    Errors that one method is the cheapest for are named together.
    """
    return [
        f"{str(role).capitalize()} fabrics, error of the colour: {_for_errors(group, limits, 'ns')}."
        for role, group in table.groupby("role", sort=False)
    ]


def least_flicker_sentences(table: pd.DataFrame) -> list[str]:
    """Return the same for the distance of the receding plane's flicker from the truth's."""
    return [
        f"{str(role).capitalize()} fabrics, flicker: {_for_flicker(group, 'ns')}."
        for role, group in table.groupby("role", sort=False)
        if group["flicker"].notna().any()
    ]


def scene_sentences(table: pd.DataFrame) -> dict[str, list[str]]:
    """Return for each scene which method costs least within errors of the colour and of flicker, and what is noise.

    Parameters
    ----------
    table : DataFrame
        From `summary.scene_table`.
    """
    result = {}
    # What is lost in the noise may be as large as the upper end of its interval.
    lost = table["colour_rrmse"] == 0
    error = table["colour_rrmse"].where(~lost, table["colour_rrmse_high"])
    table = table.assign(flicker=table["flicker"].abs(), error=error, lost=lost)
    for scene, group in table.groupby("scene", sort=False) if len(table) else ():
        timed, found = group[group["frame_time"].notna()], []
        if len(timed):
            within = _for_errors(timed, LIMITS[:3], "frame_time")
            found.append(f"Error of the colour: {within}.")
        if timed["flicker"].notna().any():
            found.append(f"Flicker: {_for_flicker(timed, 'frame_time')}.")
        names = [display(row.method, row.setting) for row in rows(group[group["lost"]])]
        if names:
            found.append(f"The error of {_and(names)} is in the noise: the truth’s own explains it all.")
        result[str(scene)] = found
    return result


def _for_errors(table: pd.DataFrame, limits: Sequence[float], cost: str) -> str:
    """Return what costs least within each `error`."""
    return _cheapest(table, {limit: f"{100 * limit:g} %" for limit in limits}, cost, "error", "for {}")


def _for_flicker(table: pd.DataFrame, cost: str) -> str:
    """Return what costs least within each distance of `flicker` from the truth's."""
    named = {limit: f"{limit:g}".removeprefix("0") for limit in FLICKER_LIMITS}
    return _cheapest(table, named, cost, "flicker", "within {} of the truth’s")


def _cheapest(table: pd.DataFrame, limits: Mapping[float, str], cost: str, fault: str, where: str) -> str:
    """Return what costs least within each limit; limits that one method is the cheapest for are named together."""
    said: dict[str, list[str]] = {}
    for limit, name in limits.items():
        best = cheapest(table, limit, cost, fault)
        text = f"{display(best.method, best.setting)} ({_cost(getattr(best, cost), cost)})" if best else ""
        said.setdefault(text, []).append(name)
    parts = [f"{where.format(_and(found))} the cheapest is {text}" for text, found in said.items() if text]
    if missed := said.get(""):
        parts.append(f"{_and(missed)} {'is' if len(missed) == 1 else 'are'} reached by none")
    return "; ".join(parts)


def _cost(value: float, cost: str) -> str:
    """Return the time of a query or of a frame."""
    return f"{value:,.0f}{NO_BREAK}ns" if cost == "ns" else f"{significant(value)}{NO_BREAK}ms"


def equal_time_sentences(table: pd.DataFrame, measure: str = "colour") -> list[str]:
    """Return for each method whether any rival errs less in the same time, and where, from `equal_time_table`."""
    result = []
    found = table[(table["measure"] == measure) & table["ratio"].notna()]
    for (method, setting), group in found.groupby(["method", "setting"], sort=False):
        name, lost = display(str(method), str(setting)), group[group["ratio"] < 1.0]
        if len(lost):
            parts = [_where(str(rival), part) for rival, part in lost.groupby("rival", sort=False)]
            result.append(f"{name}: in the same time, less error by {'; '.join(parts)}.")
        else:
            (closest,) = rows(group.nsmallest(1, "ratio"))
            near = f"{display(closest.rival)}, {closest.ratio:.2f}× its error {_size(closest.size)}"
            result.append(f"{name}: in the same time no rival errs less at any size; the closest is {near}.")
    return result


def _where(rival: str, lost: pd.DataFrame) -> str:
    """Return where a rival errs less, and how much at best."""
    sizes = [size for size in lost["size"] if size != WHOLE]
    places = (
        "at every size" if len(sizes) == len(SIZES) else f"at {_and(sizes)}" if sizes else "over all sizes together"
    )
    return f"{display(rival)} {places} (down to {lost['ratio'].min():.2f}×)"


def _size(name: str) -> str:
    return "over all sizes" if name == WHOLE else f"at footprints {name}"


def beaten(table: pd.DataFrame) -> dict[str, list[str]]:
    """Return for each role the methods of which no knob is on the front."""
    result = {}
    for role, group in table.groupby("role", sort=False):
        best = set(group.loc[group["front"], "method"])
        result[str(role)] = [display(name) for name in dict.fromkeys(group["method"]) if name not in best]
    return result


def _and(words: Sequence[str]) -> str:
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last


def caveats(options: BenchOptions, per_material: Sequence[str], errors: pd.DataFrame) -> list[str]:
    """Return what a reader must know before quoting a number."""
    view = options.view
    notes = [
        "The conditions of the published table (data set, ranges, training, footprints) are not known. Our ratios are "
        "the paper's comparison repeated on this project's own ground truth, not a reproduction of its numbers.",
        "The truth is that of the model: yarns as bent, twisted cylinders, one layer of fibres scattering once, plus a "
        "diffuse lobe; reflection only. It is not a measurement of real cloth.",
        "Times are those of this machine and of code called from Python, a batch of queries at a time; the paper's are "
        "of a GPU renderer. Only ratios within one column mean anything.",
        "One training, one seed: how much another training would differ was not measured.",
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
            f"{names} learns every fabric by itself, so no fabric is unseen to it; its rows stand for comparison."
        )
    return notes


def lacking(records: Sequence[Record]) -> list[str]:
    """Return a sentence for each way of running methods that the machine lacked, with the reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for record in records:
        if record.metric == "not_run":
            reasons.setdefault((record.setting, record.note), []).append(display(record.method))
    return [
        f"{_and(list(dict.fromkeys(methods)))} by {runtime} {'was' if len(set(methods)) == 1 else 'were'} not measured "
        f"({reason.rstrip('.')})."
        for (runtime, reason), methods in reasons.items()
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


def _comparison(ratio: float) -> str:
    return f"{_number(ratio)}× lower MSE" if ratio >= 1 else f"{_number(1 / ratio)}× higher MSE"


def _number(value: float) -> str:
    return f"{value:.1f}" if value < 100 else f"{value:,.0f}"


def _fabrics(count: int, role: str) -> str:
    return f"the {role} fabric" if count == 1 else f"the {count} {role} fabrics"
