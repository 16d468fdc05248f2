"""`twillight compare`: the Records of two benchmarks, and a table of their differences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from jobs.verbs.parameters import Local, OfSeveralPages
from weaves.errors import BadInput

if TYPE_CHECKING:
    from rich.table import Table

    from reports.record import Record
    from reports.tables.compare import Difference

WHERE = "compare"


def compare(
    a: Annotated[Local, Parameter(help="Folder of products, folder of a page, or file of Records.")],
    b: Annotated[Local, Parameter(help="Another one; the table shows B relative to A.")],
    *,
    recipe: OfSeveralPages = "",
    other_machine: Annotated[bool, Parameter(help="Allow measurements of different machines.")] = False,
) -> None:
    """Print the differences of B from A.

    Raises
    ------
    BadInput
        If one has no Records or no machine, the machines differ without `other_machine`, or no measurement is shared.
    """
    from jobs.terminal import Terminal
    from reports.machines import refuse_several
    from reports.record import read_machine, read_records
    from reports.tables.compare import LEVEL, NO_DIFFERENCE, refuse_other_machine
    from reports.tables.compare import compare as differences
    from reports.tables.sentences import busy

    files = [records_file(path, recipe) for path in (a, b)]
    first, second = (read_records([file]) for file in files)
    for file, records in zip(files, (first, second), strict=True):
        refuse_several(records, str(file))
    machine_a, machine_b = (read_machine(file) for file in files)
    unlike = refuse_other_machine(machine_a, machine_b, other_machine)
    found = differences(first, second)
    console = Terminal()
    for title, rows in (("time", found.times), ("MSE, 95 % interval", found.errors)):
        if rows:
            console.print(_table(title, rows), "")
    for sentence in [*unlike, *found.unlike, *busy(first, second)]:
        console.print(f"{sentence}.", soft_wrap=True)
    left = [f"{count} only in {name}" for name, count in (("A", found.only_a), ("B", found.only_b)) if count]
    marked = sum(one.result not in NO_DIFFERENCE for one in (*found.times, *found.errors))
    summary = (
        f"{marked} of {len(found.times) + len(found.errors)} measurements differ{''.join(f'; {part}' for part in left)}"
    )
    level = f"if nothing changed, any is marked at most once in {1 / LEVEL:.0f} comparisons (Holm)"
    load = "Load on the machine is not part of this test: first compare two runs of A, on a quiet machine."
    console.print(f"{summary}; {level}.", *([load] if found.times else []), soft_wrap=True)


def records_file(path: Path, recipe: str = "") -> Path:
    """Return the file of Records of a path: itself, that of a page's folder, or of the page in a folder of products.

    Raises
    ------
    BadInput
        If there is none, or there are several.
    """
    from reports.record import OF_A_PAGE

    if path.is_file():
        return path
    if not path.is_dir():
        raise BadInput(str(path), "", "does not exist", "a folder of products, of a page, or a file of Records")
    if not recipe and (path / OF_A_PAGE).is_file():
        return path / OF_A_PAGE
    found = sorted(path.glob(f"report/{recipe or '*'}/{OF_A_PAGE}"))
    if not found:
        what = f"no page of the recipe {recipe}" if recipe else "no page"
        raise BadInput(str(path), "", f"holds {what} with Records", "write one with `twillight report` first")
    if len(found) > 1:
        pages = ", ".join(file.parent.name for file in found)
        raise BadInput(str(path), "", "holds several pages", f"choose one with --recipe: {pages}")
    return found[0]


def _table(title: str, rows: Sequence[Difference]) -> Table:
    """Return differences as a table: subject, A, B, B over A, p-value and result; significant ones are bold."""
    from rich.table import Table

    from reports.tables.compare import NO_DIFFERENCE
    from reports.tables.number_format import display

    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for name in ("method", title, "A", "B", "B / A", "p", ""):
        table.add_column(name, justify="right" if name in ("A", "B", "B / A", "p") else "left")
    for row in rows:
        p = "" if math.isnan(row.p) else f"{row.p:.2g}" if row.p >= 1e-3 else "< .001"
        style = "" if row.result in NO_DIFFERENCE else "bold"
        values = [_value(one) for one in (row.a, row.b)]
        method = display(row.a.method, row.a.setting)
        table.add_row(method, _what(row), *values, _number(row.ratio), p, row.result, style=style)
    return table


def _what(row: Difference) -> str:
    """Return the subject of a measurement, without the method."""
    one = row.a
    if one.metric == "time":
        return f"a query, {one.threads} thread{'' if one.threads == 1 else 's'}" if one.threads else "a query"
    return {"prepare_time": "to add a fabric", "encode_time": f"to edit {one.note}"}.get(one.metric, one.fabric)


def _value(one: Record) -> str:
    """Return a time with its unit, or an error with half its 95 % interval."""
    if one.unit != "1":
        return f"{one.value:,.4g} {one.unit.split('/')[0]}"
    half = "" if one.standard_error is None else f" ± {1.96 * one.standard_error:.1e}"
    return f"{one.value:.2e}{half}"


def _number(value: float) -> str:
    return "–" if math.isnan(value) else f"{value:.3g}"
