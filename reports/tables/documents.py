"""Documents from the Records of one page: the table of README.md, and all tables as reports/RESULTS.md.

Errors and flicker are the same in every run on one machine. Times are not: in README.md a time that is printed already
is kept while the new one lies within a quarter of it, so that a fresh run of the same recipe changes no byte.
"""

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from typing import Any, Final

import pandas as pd

from reports.record import Machine, Record
from reports.tables import summary
from reports.tables.number_format import NONE, fixed_to, listed, scientific, times
from reports.tables.page_tables import page_frames, sections
from reports.tables.sentences import BOUNDED
from reports.tables.summary import BASELINE, PAPER_SAYS, over_unseen, rows
from reports.tables.table import markdown_table, number
from weaves.errors import BadInput

MARKERS: Final = ("<!-- quick: written by `make readme`, do not edit -->\n", "<!-- end of quick -->\n")
"""Lines of README.md before and after the generated block."""

README_METHODS: Final[Mapping[tuple[str, str], str]] = {
    BASELINE: "two random points, exact shadows",
    ("point_sampled", "k = 16"): "sixteen random points",
    ("neumip", ""): "`neumip`: one neural texture for each fabric \\*",
    ("woven", ""): "`woven`: one network for all fabrics",
    ("woven", BOUNDED): "`woven` under the energy bound",
    ("soft_nodes", "k = 2"): "`soft_nodes`: a sum over few nodes, nothing is trained",
}
"""Methods and settings that README.md shows, each in words."""


def readme_block(records: Sequence[Record], machine: Machine, old: str, where: str) -> str:
    """Return the block: table, headline of `woven`, and where it was measured.

    Records and machine are those of one page, from the file `where`. Of the `old` block the times are kept where they
    still hold. BadInput if the Records hold no errors and times of two random points.
    """
    condensed, errors = summary.summary_table(records), summary.error_table(records)
    needed = {"MSE seen", "× lower, seen", "MSE unseen", "× lower, unseen", "flicker", "× time"}
    if BASELINE not in condensed.index or not needed <= set(condensed.columns):
        fault = "lacks errors, flicker or times of two random points"
        raise BadInput(where, "", fault, "Records of a whole page are needed")
    left_out = summary.unranged(errors)
    ratios = {(row.role, row.method, row.setting): _ratio(row) for row in rows(errors)} | dict.fromkeys(left_out, NONE)
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in old.splitlines() if line.startswith("|")]
    printed = {first: last for first, *_, last in cells}
    lines: dict[str, tuple[str, ...]] = {}
    for (method, setting), words in README_METHODS.items():
        if (method, setting) in condensed.index:
            row: Any = condensed.loc[(method, setting)]
            own = [ratios.get((role, method, setting), NONE) for role in ("seen", "unseen")]
            time = kept_time(printed.get(words, NONE), row["× time"])
            lines[words] = (words, scientific(row["MSE seen"], 1), *own, two_decimals(row["flicker"]), time)
    held_out = errors[summary.of_baseline(errors)]
    fabrics = " and ".join(f"{row.fabrics} {row.role}" for row in rows(held_out))
    provenance = next(record.provenance for record in records if record.provenance.recipe)
    several = any(over_unseen(row) for row in rows(errors))
    return "\n\n".join(
        [
            markdown_table(("method", "MSE", "× lower", "× lower, unseen", "flicker", "× time"), lines.values()),
            *_woven(lines),
            f"Recipe `{provenance.recipe}`, benchmark version {provenance.version}, {machine.cores} cores of "
            f"{machine.cpu}; {held_out['queries'].sum():,} held-out queries of {fabrics} fabrics. "
            "MSE: mean squared error of the colour on seen fabrics. × lower: the MSE of two points over that of the "
            "method, on seen and on unseen fabrics. Flicker: variance over time beyond that of the truth (below 0: "
            "less, by blur), over its squared mean, on all fabrics. × time: of one query on one thread, over that of "
            "two points; times within a quarter, because no two runs take equally long. \\* Trained on each fabric "
            "that it is measured on. "
            + "On several unseen fabrics: geometric mean, in parentheses its 95 % interval over fabrics. " * several
            + "–: one training, one fabric: no range. " * bool(left_out)
            + _trainings(errors),
        ]
    )


def _ratio(row: Any) -> str:
    """Return × lower with its interval over several unseen fabrics, and its range over several trainings."""
    if over_unseen(row) and (row.method, row.setting) != BASELINE:
        return str(number("ratio_fabrics", "× lower", "times").cell(row))
    return str(number("ratio", "× lower", "times", ends=("", "")).cell(row))


def _trainings(errors: pd.DataFrame) -> str:
    counts = sorted({int(count) for count in errors["seeds"] if count})
    if not counts or counts[-1] == 1:
        return "Each network was trained once."
    numbers = listed([str(count) for count in counts])
    return f"Networks: means over {numbers} trainings, in brackets the least and the most of them."


def _woven(lines: Mapping[str, Sequence[str]]) -> list[str]:
    """Return the comparison that the paper of `woven` makes, with our numbers and its own; none without `woven`."""
    for setting, name in ((BOUNDED, "`woven` under the energy bound"), ("", "`woven`")):
        if line := lines.get(README_METHODS["woven", setting]):
            _, _, seen, unseen, _, time = line
            others = f", and {unseen} on unseen ones" if unseen != NONE else ""
            where = f"two points on seen fabrics at {time} their time{others}"
            return [f"{name} has {seen} lower MSE than {where}; {PAPER_SAYS}"]
    return []


def two_decimals(value: float) -> str:
    """Return ``0.01``; what rounds to 0 has no sign."""
    return fixed_to(round(value, 2) + 0.0, 2).replace("-", "−")


def kept_time(printed: str, fresh: float) -> str:
    """Return a ratio of times with two digits; the printed one if they differ by a factor of 1.25 at most."""
    try:
        old = float(printed.removesuffix("×").replace(",", ""))
    except ValueError:
        return times(fresh)
    near = fresh > 0 and old > 0 and max(fresh / old, old / fresh) <= 1.25
    return printed if near else times(fresh)


def results_page(records: Sequence[Record], machine: Machine, where: str) -> str:
    """Return all tables of a page as one Markdown file; arguments as in `readme_block`.

    BadInput if no Record names its recipe.
    """
    named = [record.provenance for record in records if record.provenance.recipe]
    if not named:
        raise BadInput(where, "", "names no recipe", "Records of a whole page are needed")
    packages = ", ".join(f"{name} {number}" for name, number in machine.packages.items())
    head = [
        f"Recipe `{named[0].recipe}`, fingerprint `{named[0].recipe_fingerprint[:16]}`",
        f"Twillight {version('twillight')}, benchmark version {named[0].version}",
        f"Machine: {machine.cpu}, {machine.cores} cores, {machine.system}",
        f"Python {machine.python}, {packages}",
        f"Measured on {machine.date[:10]}",
    ]
    about = (
        f"Written by `make results RECIPE={named[0].recipe}` from the Records of the page; do not edit. The page "
        "defines every column and shows the pictures. What was tried and not kept is in [LOG.md](LOG.md)."
    )
    parts = [f"# Results of the recipe `{named[0].recipe}`", about, "\n".join(f"- {line}" for line in head)]
    for section in sections(records, page_frames(records)).values():
        if section.tables:
            parts += [f"## {section.title}", *section.intro]
            parts += ["\n".join(f"- {sentence}" for sentence in section.sentences)] if section.sentences else []
            for part in section.tables:
                parts += [f"### {part.title}", *part.intro, part.markdown(), *part.note]
            parts += section.note
    return "\n\n".join(parts) + "\n"


def split_at_block(text: str, where: str) -> tuple[str, str, str]:
    """Return a text up to the generated block with the marker before it, the block, and the rest.

    BadInput if the text does not hold both markers, the first one first; `where` names the file.
    """
    first, last = MARKERS
    before, opened, after = text.partition(first)
    inside, closed, rest = after.partition(last)
    if not opened or not closed:
        needed = f"the lines {first.rstrip()!r} and {last.rstrip()!r} are needed"
        raise BadInput(where, "", "has no block 'quick'", needed)
    return before + opened, inside, closed + rest
