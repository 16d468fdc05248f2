"""Sentences of a page: the trade, its methods, what sums up a table, limits of the numbers, what was not measured."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from reports.measure.by_size import SIZES, WHOLE
from reports.over_seeds import LEAST, MOST, trainings
from reports.record import TRUTH, Record
from reports.tables.number_format import NO_BREAK, NONE, display, listed, percent, plain, shown, significant, times
from reports.tables.summary import BASELINE, OF_PAPER, PAPER_SAYS, of_baseline, over_unseen, parts_of, rows, unranged
from reports.tables.tradeoff import FAULTS, LIMITS, Fault, cheapest

BOUNDED: Final = "bounded"  # setting of a network under the energy bound (`pipeline.models.bounded`)
QUIET: Final = 0.02  # share of the time that methods wait for others on a machine that counts as quiet


def trade(tradeoff: pd.DataFrame) -> tuple[str, list[dict[str, str]]]:
    """Return the headline of the trade and its four figures.

    They are the cheapest methods within the first three `LIMITS` on the fabrics of the first role, and what a pixel of
    two points gets. Both are empty where two points were not measured.
    """
    part = tradeoff[tradeoff["role"] == tradeoff["role"].iloc[0]] if len(tradeoff) else tradeoff
    base = next(rows(part[of_baseline(part)]), None)
    if base is None:
        return "", []
    figures: list[dict[str, str]] = []
    reached: dict[str, list[str]] = {}
    for limit in LIMITS[:3]:
        best = cheapest(part, "ns", error=limit)
        name = display(best.method, best.setting) if best else "no method"
        ratio = times(best.ns / base.ns) if best else NONE
        note = f"{name}: {'the cheapest ' if best else ''}within {100 * limit:g} % error, in times of two points"
        figures.append({"value": ratio, "note": note})
        words = f"{name} at {ratio} the time of two points" if best else name
        reached.setdefault(words, []).append(f"{100 * limit:g} %")
    worst = percent(base.error, 0)
    figures.append({"value": worst, "note": f"error of a pixel of two points, in {base.ns:,.0f} ns"})
    within = "; ".join(f"within {listed(limits)} error: {name}" for name, limits in reached.items())
    where = _fabrics(base.fabrics, base.role)
    return f"A pixel of two random points has an error of {worst} on {where}. Cheapest {within}.", figures


def own_figures(method: str, errors: pd.DataFrame, timing: pd.DataFrame) -> list[dict[str, str]]:
    """Return the figures of a method from outside, in its first setting: × lower, error of the colour, and × time."""
    own = next(rows(errors[errors["method"] == method]), None)
    if own is None:
        return []
    ratios = timing[(timing["method"] == method) & (timing["setting"] == own.setting)]["time_ratio"]
    lower = not own.ratio < 1
    figures = {
        f"{'lower' if lower else 'higher'} MSE than two points": times(own.ratio if lower else 1 / own.ratio),
        f"error of its colour on {_fabrics(own.fabrics, own.role)}": percent(own.colour_rrmse),
        "time of a query, in times of two points": times(next(iter(ratios), math.nan)),
    }
    name = display(method, own.setting)
    return [{"value": value, "note": f"{name}: {note}"} for note, value in figures.items() if value != NONE]


def headline(method: str, setting: str, errors: pd.DataFrame, timing: pd.DataFrame, paper: bool = True) -> str:
    """Return the paper's sentence with our numbers, and with the paper's; empty if there is no ratio to print.

    A mean over trainings has its range; a single training is called one. On several unseen fabrics the ratio is the
    geometric mean, with its 95 % interval over fabrics.
    """
    own = errors[(errors["method"] == method) & (errors["setting"] == setting) & errors["ratio"].notna()]
    parts = [_part(row) for row in rows(own)]
    if not parts:
        return ""
    (first, where), *others = parts
    more = "".join(f", and {ratio} on {fabrics}" for ratio, fabrics in others)
    ratios = timing[(timing["method"] == method) & (timing["setting"] == setting)]["time_ratio"]
    cost = f", at {ratios.iloc[0]:.2g}× its time" if len(ratios) and math.isfinite(ratios.iloc[0]) else ""
    name = display(method, setting)
    text = f"{name[0].upper()}{name[1:]} reaches {first} than point sampling at 2 points on {where}{cost}{more}"
    text += " (one training)" if own["seeds"].iloc[0] == 1 else ""
    return f"{text}; {PAPER_SAYS}" if paper else f"{text}."


def learnt(errors: pd.DataFrame, untrained: Collection[str] = (BASELINE[0],)) -> list[tuple[str, str]]:
    """Return the setting of each method that the headline names.

    It is the form under the energy bound where that was measured: its error on validation cloths is lower. Otherwise
    it is the first. The truth, and methods that nothing is trained for, are left out.
    """
    if errors.empty:
        return []
    settings = errors.groupby("method", sort=False)["setting"].agg(list).drop([TRUTH, *untrained], errors="ignore")
    return [(str(method), BOUNDED if BOUNDED in known else known[0]) for method, known in settings.items()]


def _part(row: Any) -> tuple[str, str]:
    """Return the comparison of a ratio (below 1: of its inverse), with its range over trainings; and its fabrics."""
    where, name = _fabrics(row.fabrics, row.role), "ratio"
    if over_unseen(row):
        name = "ratio_fabrics"
        low, high = _ends(row.ratio_fabrics, row.ratio_fabrics_low, row.ratio_fabrics_high)
        where += f" (geometric mean, 95 % interval over fabrics {low}× to {high}×)"
    ratio = getattr(row, name)
    words = f"{_number(ratio)}× lower MSE" if ratio >= 1 else f"{_number(1 / ratio)}× higher MSE"
    if math.isfinite(least := getattr(row, name + LEAST)):
        low, high = _ends(ratio, least, getattr(row, name + MOST))
        words += f" ({low}× to {high}× over {row.seeds} trainings)"
    return words, where


def _ends(ratio: float, low: float, high: float) -> tuple[str, str]:
    """Return the ends of a ratio's interval; of a ratio below 1 those of its inverse, in rising order."""
    ends = (low, high) if ratio >= 1 else (1 / high, 1 / low)
    return _number(ends[0]), _number(ends[1])


def _number(value: float) -> str:
    return f"{value:.2g}" if value < 1 else f"{value:.1f}" if value < 100 else f"{value:,.0f}"


def _fabrics(count: int, role: str) -> str:
    return f"one {role} fabric" if count == 1 else f"the {count} {role} fabrics"


_SUBJECTS: Final = {"error": "error of the colour", "flicker": "flicker"}


def cheapest_sentences(table: pd.DataFrame, fault: Fault = "error") -> list[str]:
    """Return for each role the cheapest method within each limit of a fault, from `tradeoff.tradeoff_table`."""
    return [
        f"{role.capitalize()} fabrics, {_SUBJECTS[fault]}: {_cheapest(group, fault, 'ns')}."
        for role, group in parts_of(table, "role")
        if group[fault].notna().any()
    ]


def scene_sentences(table: pd.DataFrame) -> dict[str, list[str]]:
    """Return for each scene the cheapest methods within errors of the colour and of flicker, and errors in the noise.

    The frame is from `summary.scene_table`.
    """
    result: dict[str, list[str]] = {}
    # An error in the noise may be as large as the upper end of its interval.
    lost = table["colour_rrmse"] == 0
    error = table["colour_rrmse"].where(~lost, table["colour_rrmse_high"])
    table = table.assign(flicker=table["flicker"].abs(), error=error, lost=lost)
    for scene, group in parts_of(table, "scene"):
        timed, result[scene] = group[group["frame_time"].notna()], []
        for fault in FAULTS if len(timed) else ():
            if fault == "error" or timed[fault].notna().any():
                within = _cheapest(timed, fault, "frame_time", most=3)
                result[scene].append(f"{_SUBJECTS[fault].capitalize()}: {within}.")
        if names := [display(row.method, row.setting) for row in rows(group[group["lost"]])]:
            result[scene].append(f"In the noise of the truth: the error of {listed(names)}.")
    return result


def _cheapest(table: pd.DataFrame, fault: Fault, cost: str, most: int | None = None) -> str:
    """Return the cheapest method within each limit of a fault; limits with the same method are named together."""
    reached: dict[str, list[str]] = {}
    for limit in FAULTS[fault][:most]:
        text = ""
        if best := cheapest(table, cost, **{fault: limit}):
            time = f"{best.ns:,.0f}{NO_BREAK}ns" if cost == "ns" else f"{significant(best.frame_time)}{NO_BREAK}ms"
            text = f"{display(best.method, best.setting)} ({time})"
        name = f"{100 * limit:g} %" if fault == "error" else f"{limit:g}".removeprefix("0")
        reached.setdefault(text, []).append(name)
    of = " of the truth" if fault == "flicker" else ""
    sentences = [f"cheapest within {listed(names)}{of}: {text}" for text, names in reached.items() if text]
    if missed := reached.get(""):
        sentences.append(f"no method reaches {' or '.join(missed)}{of}")
    return "; ".join(sentences)


def _equal_time_sentences(table: pd.DataFrame) -> list[str]:
    """Return for each method the rivals with a lower error of the colour in the same time, and where."""
    result = []
    compared = table[(table["measure"] == "colour") & table["ratio"].notna()]
    for (method, setting), group in compared.groupby(["method", "setting"], sort=False):
        name, lost = display(str(method), str(setting)), group[group["ratio"] < 1.0]
        if len(lost):
            rivals = "; ".join(_where(rival, part) for rival, part in parts_of(lost, "rival"))
            result.append(f"{name}: rivals with a lower error in the same time: {rivals}.")
        else:
            (closest,) = rows(group.nsmallest(1, "ratio"))
            where = "over all sizes" if closest.size == WHOLE else f"at footprints {closest.size}"
            near = f"{display(closest.rival)} with {closest.ratio:.2f}× its error {where}"
            result.append(f"{name}: no rival has a lower error in the same time at any size; the closest is {near}.")
    return result


def _where(rival: str, lost: pd.DataFrame) -> str:
    """Return the sizes at which a rival has a lower error, and its lowest ratio."""
    sizes = [size for size in lost["size"] if size != WHOLE]
    places = f"at footprints {listed(sizes)}" if sizes else "over all sizes together"
    places = "at every size" if len(sizes) == len(SIZES) else places
    return f"{display(rival)} {places} (ratio down to {lost['ratio'].min():.2f}×)"


def section_sentences(frames: Mapping[str, pd.DataFrame]) -> dict[str, list[str]]:
    """Return the sentences of each section, from `page_tables.page_frames` or `ranged_frames`; of scenes by scene."""
    scenes = scene_sentences(frames["scenes"])
    return {
        "trade": cheapest_sentences(frames["tradeoff"]),
        "equal-time": _equal_time_sentences(frames["equal_time"]),
        "aliasing": cheapest_sentences(frames["tradeoff"], "flicker"),
        "scenes": [f"{plain(scene).capitalize()}: {text}" for scene, texts in scenes.items() for text in texts],
    }


def facts(records: Sequence[Record], errors: pd.DataFrame, per_material: Collection[str] = ()) -> dict[str, object]:
    """Return the values of words (`tables.toml`) that Records tell; what was not measured is not among them.

    `errors` is from `summary.error_table`; methods `per_material` are trained on every fabric by itself.
    """
    metrics = {record.metric for record in records}
    counts: dict[str, int] = {}
    for row in rows(errors) if len(errors) else ():
        counts[display(row.method)] = max(row.seeds, counts.get(display(row.method), 0))
    once = [name for name, n in counts.items() if n == 1]
    several = [name for name, n in counts.items() if n > 1]
    unseen = errors[errors["role"] == "unseen"]["fabrics"].max() if len(errors) else 0
    black = errors[of_baseline(errors) & (errors["zero_answers"] > 0)] if len(errors) else errors
    motion = [record.value for record in records if record.metric == "motion"]
    truth = [record.value for record in records if record.metric == "truth_relative_error"]
    share, most = waited(records), max(trainings(records).values(), default=0)
    methods = set(errors["method"]) if len(errors) else set()
    known = {
        "paper_of": {OF_PAPER, BASELINE[0]} <= methods and display(OF_PAPER),
        "trainings": most > 1 and most,
        "once": once and listed(once),
        "several": several and listed(several),
        "training_counts": several and listed(sorted({str(counts[name]) for name in several})),
        "timed_apart": "unseen" if any(record.metric == "time" and record.role for record in records) else "",
        "one_unseen": "One" if unseen == 1 else "",
        "unseen_fabrics": int(unseen) if unseen > 1 else 0,
        "unranged": ", ".join(display(method, setting) for _, method, setting in sorted(unranged(errors))),
        "bounded": "Bounded" if len(errors) and BOUNDED in set(errors["setting"]) else "",
        "black": f"{float(black['zero_answers'].mean()):.0%}" if len(black) else "",
        "per_material": per_material and listed(list(map(display, per_material))),
        "waited": "" if math.isnan(share) else f"{100 * share:.1f} %",
        "busy": f"{100 * share:.1f} %" if share >= QUIET else "",
        "not_by_eye": "not scored" if "frame_time" in metrics and "fovvideovdp" not in metrics else "",
        "truth_error": percent(float(np.mean(truth)), 2) if truth else "",
        "motion": shown("motion", float(np.mean(motion))) if motion else "",
    }
    return {name: value for name, value in known.items() if value}


def lacking(records: Sequence[Record]) -> list[str]:
    """Return a sentence for each way of running methods that was not measured or timed, with the reason."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for record in records:
        if record.metric == "not_run":
            scene = f" in the scene {record.scene}" if record.scene else ""
            how = f" by {record.setting} {{}} not measured" if record.setting else f" {{}} not timed{scene}"
            reasons.setdefault((how, record.note), []).append(display(record.method))
    sentences = []
    for (how, reason), methods in reasons.items():
        names = list(dict.fromkeys(methods))
        sentences.append(f"{listed(names)}{how.format('was' if len(names) == 1 else 'were')} ({reason.rstrip('.')}).")
    return sentences


def waited(records: Iterable[Record]) -> float:
    """Return the share of the time that methods on one thread waited, the median over methods; NaN if unknown.

    A method on one thread that has nothing to wait for runs all the time it takes. What it does not run
    (`reports.measure.timing.CallTiming.waited`), other work had the processor. Work on other cores that slows memory or
    the clock is not seen by this.
    """
    shares = [record.value for record in records if record.metric == "waited"]
    return float(np.median(shares)) if shares else math.nan


def busy(a: Iterable[Record], b: Iterable[Record]) -> list[str]:
    """Return a sentence for a comparison if methods of A or B had to wait."""
    shares = {name: waited(records) for name, records in (("A", a), ("B", b))}
    parts = [f"{name} waited {100 * share:.0f} % of the time" for name, share in shares.items() if share >= QUIET]
    words = "Other work ran on the machine while methods were timed"
    return [f"{words}, {' and '.join(parts)}: times may differ by that"] if parts else []
