"""The table of README.md: six methods in a few numbers, from the Records of one page.

Errors and flicker are the same in every run on one machine. Times are not: a time that is printed already is kept
while the new one lies within `TOLERANCE` of it, so that a fresh run of the same recipe changes no byte.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import pandas as pd

from reports.over_fabrics import over_unseen
from reports.record import Machine, Record
from reports.tables.headline import BOUNDED
from reports.tables.markdown import markdown_table
from reports.tables.number_format import NONE, interval, listed, missing, span, times
from reports.tables.summary import BASELINE, PAPER, error_table, of_baseline, rows, summary_table
from weaves.errors import BadInput

BLOCK: Final = "quick"
"""Name of the block in README.md."""

TOLERANCE: Final = 1.25
"""Factor by which a time may differ from the one that is printed."""

ROWS: Final[Mapping[tuple[str, str], str]] = {
    BASELINE: "two random points, exact shadows",
    ("point_sampled", "k = 16"): "sixteen random points",
    ("neumip", ""): "`neumip`: one neural texture for each fabric \\*",
    ("woven", ""): "`woven`: one network for all fabrics",
    ("woven", BOUNDED): "`woven` under the energy bound",
    ("soft_nodes", "k = 2"): "`soft_nodes`: a sum over few nodes, nothing is trained",
    ("selvage", ""): "`selvage`: soft nodes corrected by a small network",
}
"""Methods and settings that the table shows, each in words."""

COLUMNS: Final = ("method", "MSE", "× lower", "× lower, unseen", "flicker", "× time")


def readme_block(records: Sequence[Record], machine: Machine, old: str, where: str) -> str:
    """Return the block: table, headline of `woven`, and where it was measured.

    Parameters
    ----------
    records : sequence of Record
        Of one page.
    machine : Machine
        Where its times were taken.
    old : str
        The block as it is now; its times are kept where they still hold.
    where : str
        File of the Records, for the error.

    Raises
    ------
    BadInput
        If the Records hold no errors and times of two random points.
    """
    found = summary_table(records)
    needed = {"MSE seen", "× lower, seen", "MSE unseen", "× lower, unseen", "flicker", "× time"}
    if BASELINE not in found.index or not needed <= set(found.columns):
        raise BadInput(
            where, "", "lacks errors, flicker or times of two random points", "Records of a whole page are needed"
        )
    table = error_table(records)
    ratios_of = {(row.method, row.setting, row.role): _ratio(row) for row in rows(table)}
    printed, lines = _printed_times(old), []
    numbers: dict[Any, dict[Any, float]] = {key: dict(row) for key, row in found.to_dict("index").items()}
    for key, words in ROWS.items():
        if row := numbers.get(key):
            ratios = (ratios_of.get((*key, role), NONE) for role in ("seen", "unseen"))
            time = kept_time(printed.get(words, NONE), row["× time"])
            lines.append((words, two_digits(row["MSE seen"]), *ratios, three_decimals(row["flicker"]), time))
    held_out = table[of_baseline(table)]
    fabrics = " and ".join(f"{row.fabrics} {row.role}" for row in rows(held_out))
    provenance = next(record.provenance for record in records if record.provenance.recipe)
    return "\n\n".join(
        [
            markdown_table(COLUMNS, lines),
            *_headline(lines),
            f"Recipe `{provenance.recipe}`, benchmark version {provenance.version}, {machine.cores} cores of "
            f"{machine.cpu}; {held_out['queries'].sum():,} held-out queries of {fabrics} fabrics. "
            "MSE: mean squared error of the colour on seen fabrics. × lower: the MSE of two points over that of the "
            "method, on seen and on unseen fabrics. Flicker: variance over time beyond that of the truth, over its "
            "squared mean, on all fabrics. × time: of one query on one thread, over that of two points; times within "
            "a quarter, because no two runs take equally long. \\* Trained on each fabric that it is measured on. "
            + _over_fabrics(table)
            + _trainings(table),
        ]
    )


def _ratio(row: Any) -> str:
    """Return × lower with its interval over several unseen fabrics, and its range over several trainings."""
    if not over_unseen(row) or (row.method, row.setting) == BASELINE:
        return " ".join(filter(None, (times(row.ratio), span(times, row.ratio_least, row.ratio_most))))
    ends = f"({interval(row.ratio_fabrics_low, row.ratio_fabrics_high)})"
    trainings = span(times, row.ratio_fabrics_least, row.ratio_fabrics_most)
    return " ".join(filter(None, (times(row.ratio_fabrics), ends, trainings)))


def _over_fabrics(errors: pd.DataFrame) -> str:
    """Return a sentence on the means over several unseen fabrics; empty where there are none."""
    if not any(over_unseen(row) for row in rows(errors)):
        return ""
    return "On several unseen fabrics: geometric mean, in parentheses its 95 % interval over fabrics. "


def _trainings(errors: pd.DataFrame) -> str:
    """Return a sentence on how often networks were trained."""
    counts = sorted({int(count) for count in errors["seeds"] if count})
    if not counts or counts[-1] == 1:
        return "Each network was trained once."
    numbers = listed([str(count) for count in counts])
    return f"Networks: means over {numbers} trainings, in brackets the least and the most of them."


def _headline(lines: Sequence[Sequence[str]]) -> list[str]:
    """Return the comparison that the paper of `woven` makes, with our numbers and its own; none without `woven`."""
    found = {words: cells for words, *cells in lines}
    names = {ROWS["woven", BOUNDED]: "`woven` under the energy bound", ROWS["woven", ""]: "`woven`"}
    for words, name in names.items():
        if words in found:
            _, seen, unseen, _, time = found[words]
            lower, faster = PAPER
            ours = f"{name} has {seen} lower MSE than two points on seen fabrics, {unseen} on unseen ones, at {time}"
            return [f"{ours} their time; its paper reports {lower}× at {faster}× on its own scene and GPU."]
    return []


def two_digits(value: float) -> str:
    """Return ``2.6e-3``."""
    if missing(value):
        return NONE
    mantissa, _, exponent = f"{value:.1e}".partition("e")
    return f"{mantissa}e{int(exponent)}".replace("-", "−")


def three_decimals(value: float) -> str:
    """Return ``0.012``; what rounds to 0 has no sign."""
    return NONE if missing(value) else f"{round(value, 3) + 0.0:.3f}".replace("-", "−")


def kept_time(printed: str, fresh: float) -> str:
    """Return a ratio of times with two digits; the one that is printed if the new one is within `TOLERANCE` of it."""
    try:
        old = float(printed.removesuffix("×").replace(",", ""))
    except ValueError:
        return times(fresh)
    near = math.isfinite(fresh) and fresh > 0 and old > 0 and 1 / TOLERANCE <= fresh / old <= TOLERANCE
    return printed if near else times(fresh)


def _printed_times(old: str) -> dict[str, str]:
    """Return the last cell of every row of a table, by the first."""
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in old.splitlines() if line.startswith("|")]
    return {first: last for first, *_, last in cells}
