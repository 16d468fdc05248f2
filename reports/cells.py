"""Numbers as the page prints them: rows of cells, already worded."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Sequence
from typing import Any, Final

import numpy as np
import pandas as pd

from reports.accuracy import Accuracy
from reports.bias import Bias
from reports.effort import Effort
from reports.memory import UNSURE
from reports.record import TRUTH, Record
from reports.sampling import SETTINGS, Saving
from reports.stability import Finding
from reports.stability_methods import FOOTPRINTS, error_name
from reports.style import NO_BREAK, display
from reports.summary import BASELINE, COMPONENTS, rows
from reports.tiles import EXPOSURE, hex_colour
from reports.wording import learnt
from weaves.fabric import Fabric

Row = dict[str, Any]
NONE = "–"
COMPONENT_TITLES: Final = ("S warp", "S weft", "C warp", "C weft")


def groups(lines: Sequence[Row]) -> list[Row]:
    """Gather rows of methods: each group is a method's name and its rows; a method with knobs has a head of its own."""
    found: dict[str, list[Row]] = {}
    for line in lines:
        found.setdefault(line["method"], []).append(line)
    return [
        {"method": method, "label": display(method), "head": len(rows_) > 1, "rows": rows_}
        for method, rows_ in found.items()
    ]


def error_rows(errors: pd.DataFrame, per_material: Sequence[str]) -> dict[str, list[Row]]:
    """Return the rows of the error table by role, in groups."""
    result: dict[str, list[Row]] = {}
    for row in rows(errors):
        known = row.role == "unseen" and row.method in per_material
        line = _line(row.method, row.setting) | {
            "cells": [
                scientific(row.mse),
                f"{scientific(row.low)} … {scientific(row.high)}",
                percent(row.noise_share),
                times(row.ratio) if (row.method, row.setting) != BASELINE else "1",
                _interval(row.ratio_low, row.ratio_high) if (row.method, row.setting) != BASELINE else NONE,
                fixed(row.colour_rrmse),
                *(fixed(getattr(row, f"rrmse_{name}")) for name in COMPONENTS),
            ],
        }
        line["label"] += " *" if known else ""
        result.setdefault(row.role, []).append(line)
    return {role: groups(lines) for role, lines in result.items()}


def fabric_rows(table: pd.DataFrame) -> dict[str, Any]:
    """Return the MSE of every method on every fabric, a column a fabric; the lowest of a column is marked."""
    labels = [column for column in table.columns if column not in ("role", "fabric")]
    records = table.to_dict("records")
    best = [min((r[label] for label in labels if not _missing(r[label])), default=math.nan) for r in records]
    lines = []
    for label in labels:
        values = [(record[label], lowest) for record, lowest in zip(records, best, strict=True)]
        cells = [{"text": scientific(value), "best": value == lowest} for value, lowest in values]
        lines.append(_line(*_split(label)) | {"cells": cells})
    fabrics = [{"title": plain(str(record["fabric"])), "role": record["role"]} for record in records]
    return {"fabrics": fabrics, "groups": groups(lines)}


FRONT: Final = ("ns a query", "error of the colour", "bytes stored")
"""Columns of `front_rows` after the method."""


def front_rows(table: pd.DataFrame) -> dict[str, list[Row]]:
    """Return what is on the front by role, the fastest first."""
    result: dict[str, list[Row]] = {}
    for row in rows(table[table["front"]].sort_values("ns", kind="stable") if len(table) else table):
        cells = [f"{row.ns:,.0f}", percent(row.error, 2), size(row.bytes_stored)]
        line = _line(row.method, row.setting) | {"cells": cells}
        result.setdefault(row.role, []).append(line)
    return result


def equal_time_rows(table: pd.DataFrame) -> dict[str, Row]:
    """Return for each measure the names of the sizes, and a row a method and rival: its error, and the rival's over it.

    A rival that has no setting as fast says so.
    """
    result: dict[str, Row] = {}
    for measure, group in table.groupby("measure", sort=False) if len(table) else ():
        sizes, lines = list(dict.fromkeys(group["size"])), []
        for (method, setting, rival), found in group.groupby(["method", "setting", "rival"], sort=False):
            by_size = {row.size: row for row in rows(found)}
            cells = []
            for size in sizes:
                row = by_size[size]
                other = times(row.ratio) if math.isfinite(row.rival_error) else "too slow"
                cells.append({"text": f"{percent(row.error)} · {other}", "beaten": row.ratio < 1.0})
            lines.append(_line(str(method), str(setting)) | {"rival": display(str(rival)), "cells": cells})
        result[str(measure)] = {"sizes": sizes, "rows": lines}
    return result


SCENE: Final = (
    "colour",
    "MSE",
    "× lower",
    "PSNR",
    "SSIM",
    "FLIP",
    "HDR-FLIP",
    "ΔE",
    "flicker",
    "excess energy",
    "not its own",
    "ms a frame",
)
"""Columns of `scene_rows` after the method."""


def scene_rows(table: pd.DataFrame) -> dict[str, list[Row]]:
    """Return for each scene the rows of its table, in groups; times on the front are marked."""
    result: dict[str, list[Row]] = {}
    for scene, group in table.groupby("scene", sort=False) if len(table) else ():
        lines = []
        for row in rows(group):
            colour = percent(row.colour_rrmse) if row.colour_rrmse > 0 else "in the noise"
            cells: list[Any] = [colour, scientific(row.mse), times(row.ratio), fixed_to(row.psnr, 1)]
            cells += [fixed(value) for value in (row.ssim, row.flip_ldr, row.flip_hdr)]
            cells += [fixed_to(row.delta_e, 2), signed(row.flicker), signed(row.excess_energy)]
            cells += [percent(row.fallback_share, 0), {"text": fixed_to(row.frame_time, 1), "best": bool(row.front)}]
            lines.append(_line(row.method, row.setting) | {"cells": cells})
        result[str(scene)] = groups(lines)
    return result


def aliasing_rows(aliasing: pd.DataFrame, records: Sequence[Record]) -> dict[str, Any]:
    """Return the rows of the aliasing table in groups, and the variance that the motion itself brings."""
    motion = [record.value for record in records if record.metric == "motion"]
    roles = list(dict.fromkeys(aliasing["role"])) if len(aliasing) else []
    found: dict[tuple[str, str], dict[str, list[str]]] = {}
    for row in rows(aliasing):
        found.setdefault((row.method, row.setting), {})[row.role] = [signed(row.flicker), signed(row.excess_energy)]
    lines = [
        _line(*key) | {"cells": [text for role in roles for text in by_role.get(role, [NONE, NONE])]}
        for key, by_role in found.items()
    ]
    return {
        "groups": groups(lines),
        "roles": roles,
        "motion": scientific(float(np.mean(motion))) if motion else NONE,
    }


ENERGY: Final = ("diffuse, k_d = 1", "specular, k_s = 1", "in its own colours", "MSE, seen", "ns a query")
"""Columns of `energy_rows` after the method."""


def energy_rows(energy: pd.DataFrame, errors: pd.DataFrame, timing: pd.DataFrame) -> list[Row]:
    """Return the rows of the table of energies, in groups; what sends back more than arrives is marked."""
    lines = []
    for row in rows(energy):
        albedos = (row.diffuse, row.specular, row.colour)
        cells = [f"{value:.3f}{' ✗' if value > 1.0 else ''}" for value in albedos]
        mse = _number(errors[errors["role"] == "seen"] if len(errors) else errors, row, "mse")
        lines.append(
            _line(row.method, row.setting)
            | {"cells": [*cells, scientific(mse), grouped(_number(timing, row, "median_ns"))]}
        )
    return groups(lines)


def _number(table: pd.DataFrame, row: Any, column: str) -> float:
    """Return a column of the row of the same method and setting in another table; NaN if there is none."""
    if table.empty:
        return math.nan
    found = table[(table["method"] == row.method) & (table["setting"] == row.setting)][column]
    return float(found.iloc[0]) if len(found) else math.nan


SILHOUETTE: Final = ("coverage, RMSE", "edge too far out, yarn spacings", "light, RMSE", "fabrics")
"""Columns of `silhouette_rows` after the method."""


def silhouette_rows(table: pd.DataFrame) -> list[Row]:
    """Return the rows of the table of silhouettes, in groups."""
    lines = []
    for row in rows(table):
        cells = [fixed(row.coverage), f"{row.displacement:+.4f}".replace("-", "−"), fixed(row.light), f"{row.fabrics}"]
        lines.append(_line(row.method, row.setting) | {"cells": cells})
    return groups(lines)


def timing_columns(timing: pd.DataFrame) -> list[str]:
    """Return the columns of `timing_rows` after the method."""
    fewest, most = (timing[name].max() if len(timing) else math.nan for name in ("threads", "most_threads"))
    few = f", {fewest:.0f} threads" if fewest > 1 else ""
    many = f", {most:.0f} threads" if most > 1 else ", more threads"
    names = [f"ns a query{few}", "quartiles", "× time", f"ms a frame{few}", f"ns a query{many}", f"ms a frame{many}"]
    return [*names, "ms to add a fabric", "memory of a call", "bytes stored"]


def timing_rows(timing: pd.DataFrame) -> list[Row]:
    """Return the rows of the timing table, in groups."""
    return groups(
        [
            _line(row.method, row.setting)
            | {
                "cells": [
                    f"{row.median_ns:,.0f}",
                    f"{row.first_quartile_ns:,.0f} … {row.third_quartile_ns:,.0f}",
                    times(row.time_ratio),
                    significant(row.frame_ms),
                    significant(row.most_threads_ns),
                    significant(row.most_threads_frame_ms),
                    significant(row.prepare_ms),
                    size(row.memory) if not row.memory < UNSURE else "below " + size(UNSURE),
                    NONE if row.method == TRUTH else size(row.bytes_stored),
                ],
            }
            for row in rows(timing)
        ]
    )


def figures_of_merit(
    records: Sequence[Record],
    errors: pd.DataFrame,
    timing: pd.DataFrame,
    untrained: Collection[str] = (BASELINE[0],),
) -> list[Row]:
    """Return the few numbers at the head of the page, of the first learnt method and of the truth."""
    result = []
    methods = learnt(errors, untrained) if len(errors) else []
    if methods:
        method, setting = methods[0]
        for row in rows(errors[(errors["method"] == method) & (errors["setting"] == setting)]):
            if not _missing(row.ratio):
                fabrics = "fabric" if row.fabrics == 1 else "fabrics"
                note = f"MSE of 2 points over that of {display(method, setting)}, {row.fabrics} {row.role} {fabrics}"
                result.append({"value": times(row.ratio), "note": note, "paper": "paper: 4.1×"})
        cost = timing[(timing["method"] == method) & (timing["setting"] == setting)]["time_ratio"]
        if len(cost) and not _missing(cost.iloc[0]):
            note = f"time of a query of {display(method, setting)} over that of 2 points"
            result.append({"value": times(float(cost.iloc[0])), "note": note, "paper": "paper: 0.83×"})
    truth = [record.value for record in records if record.metric == "truth_relative_error"]
    if truth:
        note = "relative standard error of the truth: median over queries, mean over fabrics"
        result.append({"value": percent(float(np.mean(truth)), 2), "note": note, "paper": ""})
    return result


def stability_rows(findings: Sequence[Finding]) -> dict[str, list[Row]]:
    """Return the rows of the table of extremes by arithmetic: worst error, limit, the textbook's, what cannot be."""
    result: dict[str, list[Row]] = {}
    for finding in findings:
        share = finding.naive_not_finite / finding.count
        lost = f"{100 * share:.0f} % NaN" if share else ""
        naive = "" if _missing(finding.naive) or share == 1 else f"{finding.naive:.1e}"
        result.setdefault(finding.arithmetic, []).append(
            {
                "expression": finding.expression,
                "corner": finding.corner,
                "cells": [
                    f"{finding.worst:.1e}",
                    f"{finding.limit:.1e}",
                    ", ".join(filter(None, (naive, lost))) or NONE,
                    str(finding.not_finite),
                    str(finding.negative),
                ],
                "holds": finding.holds,
                "verdict": "ok" if finding.holds else "limit",
                "at": finding.at,
            }
        )
    return result


EXTREMES: Final = (
    *(f"σ {size:g}" for size in FOOTPRINTS),
    "89.9°",
    "α = .01",
    "from fp32",
    "far",
    "1e4 − 1e2",
    "NaN, ∞",
    "below 0",
)
"""Columns of `extreme_rows` after the method."""


def extreme_rows(table: pd.DataFrame) -> list[Row]:
    """Return the rows of the table of methods at their extremes, in groups; what none may answer is marked."""
    lines = []
    for row in rows(table):
        errors = [percent(getattr(row, name)) for name in map(error_name, FOOTPRINTS)]
        errors += [percent(row.grazing), percent(row.lustrous)]
        others = [NONE if _missing(x) else "0" if x == 0 else f"{x:.1e}" for x in (row.rounding, row.far, row.large)]
        wrong = [f"{count} of {row.asked} ✗" if count else "0" for count in (row.not_finite, row.negative)]
        lines.append(_line(row.method, row.setting) | {"cells": [*errors, *others, *wrong]})
    return groups(lines)


def rate_rows(records: Sequence[Record]) -> list[list[str]]:
    """Return the rows of the table of speeds: what, fabric, value with unit, note."""
    return [
        [record.setting, record.fabric or NONE, f"{record.value:,.3g} {record.unit}", record.note]
        for record in records
        if record.metric == "rate"
    ]


ACCURACY: Final = ("RMSE", "error", "stated", "points", "queries a second", "× fewer than mc")
"""Columns of `accuracy_rows` after the setting."""


def accuracy_rows(found: Sequence[Accuracy]) -> dict[str, list[list[str]]]:
    """Return the rows of the tables of accuracy by fabric: setting, then `ACCURACY`."""
    result: dict[str, list[list[str]]] = {}
    for row in found:
        numbers = [percent(row.rmse, 2), percent(row.true_error, 2), percent(row.stated_error, 2)]
        numbers += [f"{row.points:,.0f}", f"{row.rate:,.0f}", times(row.saved)]
        result.setdefault(row.fabric, []).append([row.setting, *numbers])
    return result


BIAS: Final = ("light", *COMPONENT_TITLES)
"""Columns of `bias_rows` after the fabric."""


def bias_rows(found: Sequence[Bias]) -> list[list[str]]:
    """Return the rows of the table of bias: fabric, then `BIAS`; a cell ends in ✓ if it is small, in ✗ if it is not."""
    marks = {"below": " ✓", "above": " ✗", "open": ""}
    lines: dict[tuple[str, str], dict[str, str]] = {}
    for bias in found:
        value = round(100 * bias.value, 2) + 0.0  # no zero is negative
        text = f"{value:+.2f} ± {100 * bias.standard_error:.2f} %{marks[bias.verdict]}".replace("-", "−")
        lines.setdefault((bias.fabric, bias.side), {})[bias.component] = text
    return [
        [plain(fabric), side.removeprefix("light "), *(cells.get(name, NONE) for name in COMPONENTS)]
        for (fabric, side), cells in lines.items()
    ]


SAMPLERS: Final = tuple(label for label, points in SETTINGS if points)
"""Columns of `sampler_rows` after the fabric."""


def sampler_rows(found: Sequence[Saving]) -> list[list[str]]:
    """Return how many times less variance each sampler has than the cosine, and what a direction takes."""
    lines: dict[str, dict[str, str]] = {}
    for one in found:
        lines.setdefault(one.fabric, {})[one.sampler] = f"{times(one.variance_saved)} · {one.sample_time:,.0f} ns"
    return [[plain(fabric), *(cells.get(name, NONE) for name in SAMPLERS)] for fabric, cells in lines.items()]


EFFORT: Final = ("how", "queries", "points", "µs a query", "time")
"""Columns of `effort_rows` after the fabric."""


def effort_rows(found: Sequence[Effort]) -> list[list[str]]:
    """Return the rows of the table of where the time goes: fabric, then `EFFORT`; shares are of the fabric's."""
    whole: dict[str, float] = {}
    for row in found:
        whole[row.fabric] = whole.get(row.fabric, 0.0) + row.share * row.seconds
    return [
        [
            plain(row.fabric),
            row.kind,
            percent(row.share),
            f"{row.points:,.0f}",
            f"{1e6 * row.seconds:,.0f}",
            percent(row.share * row.seconds / whole[row.fabric], 0) if whole[row.fabric] else NONE,
        ]
        for row in found
    ]


def path_rows(table: pd.DataFrame) -> list[list[str]]:
    """Return the rows of the table of what lies between: method, path, way, then the error at every share of it."""
    lines: dict[tuple[str, ...], list[str]] = {}
    for row in rows(table):
        path = f"{plain(row.fabric)} → {plain(row.to)}"
        lines.setdefault((display(row.method, row.setting), path, row.how), []).append(percent(row.error))
    return [[*key, *errors] for key, errors in lines.items()]


def edit_rows(records: Sequence[Record]) -> list[list[str]]:
    """Return the rows of the table of edits: method, what is edited, median time, quartiles."""
    return [
        [
            display(record.method, record.setting),
            record.note,
            f"{record.value:.3g} {record.unit}",
            f"{record.low:.3g} … {record.high:.3g}" if record.low is not None and record.high is not None else NONE,
        ]
        for record in records
        if record.metric == "encode_time"
    ]


def fabric_card(fabric: Fabric, role: str) -> Row:
    """Return what the gallery says of a fabric."""
    ends, picks = fabric.weave.repeat
    yarns = []
    for family, yarn in (("warp", fabric.warp), ("weft", fabric.weft)):
        numbers = [
            f"{yarn.bend:g}°",
            f"{yarn.twist:g}°".replace("-", "−"),
            f"{yarn.roughness:g}",
            f"{yarn.relief:g}",
            f"{yarn.width:g}",
        ]
        colours = [hex_colour([EXPOSURE * c for c in rgb]) for rgb in (yarn.diffuse_rgb, yarn.specular_rgb)]
        yarns.append({"family": family, "cells": numbers, "colours": colours})
    return {
        "name": fabric.name,
        "title": plain(fabric.name),
        "role": role,
        "weave": fabric.weave.name,
        "repeat": f"{ends} ends × {picks} picks",
        "source": fabric.source,
        "yarns": yarns,
    }


def plain(name: str) -> str:
    """Return a fabric's name as words: ``wool gabardine``, ``twill 4/4``."""
    return re.sub(r"(?<=\d)_(?=\d)", "/", name).replace("_", " ")


def scientific(value: float | None) -> str:
    """Return ``2.62e-3``."""
    if _missing(value):
        return NONE
    mantissa, _, exponent = f"{value:.2e}".partition("e")
    return f"{mantissa}e{int(exponent)}".replace("-", "−")


def signed(value: float) -> str:
    """Return a number with its sign; 0 has none."""
    return NONE if _missing(value) else ("+" if value > 0 else "") + scientific(value)


def times(value: float) -> str:
    """Return ``4.1×``."""
    return NONE if _missing(value) else f"{value:.2g}×" if value < 10 else f"{value:,.0f}×"


def significant(value: float) -> str:
    """Return a number with three digits or all those before the point: ``1,696``, ``12.3``, ``.0456``."""
    if _missing(value):
        return NONE
    digits = max(0, 2 - math.floor(math.log10(abs(value)))) if value else 0
    return re.sub(r"^0(?=\.)", "", f"{value:,.{digits}f}")


def percent(value: float, digits: int = 1) -> str:
    """Return ``1.5 %``."""
    return NONE if _missing(value) else f"{100 * value:.{digits}f} %"


def grouped(value: float) -> str:
    """Return ``1,696``."""
    return NONE if _missing(value) else f"{value:,.0f}"


def fixed_to(value: float, digits: int) -> str:
    """Return ``31.4``."""
    return NONE if _missing(value) else f"{value:,.{digits}f}"


def fixed(value: float) -> str:
    """Return ``.123``."""
    return NONE if _missing(value) else f"{value:.3f}".removeprefix("0")


def size(value: float) -> str:
    """Return bytes in the unit that suits them."""
    if _missing(value):
        return NONE
    return f"{value:,.0f} B" if value < 1e3 else f"{value / 1e3:,.1f} kB" if value < 1e6 else f"{value / 1e6:,.2f} MB"


def _line(method: str, setting: str) -> Row:
    """Return what any row of a method says: whose it is, and both its names, whole and within its group."""
    return {
        "method": method,
        "label": display(method, setting),
        "setting": setting.replace(" ", NO_BREAK) or display(method),
        "baseline": (method, setting) == BASELINE,
    }


def _interval(low: float, high: float) -> str:
    return NONE if _missing(low) else " … ".join(f"{v:.2g}" if v < 100 else f"{v:,.0f}" for v in (low, high))


def _missing(value: float | None) -> bool:
    return value is None or not math.isfinite(value)


def _split(label: str) -> tuple[str, str]:
    method, _, setting = label.partition(" ")
    return method, setting
