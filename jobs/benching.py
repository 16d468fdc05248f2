"""The measurements that need no recipe: `twillight bench NAME` with one of the names here.

They write their Records beside those of the recipes, so that the next page shows them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from weaves.errors import WorkFailed

if TYPE_CHECKING:
    from rich.console import RenderableType

    from reports.stability import Finding

STABILITY: Final = "records/stability.json"
"""File of the Records of `bench stability`, under the folder of all products."""

TRUTH: Final = "records/truth.json"
"""File of the Records of `bench truth`."""

RECORDS: Final = (STABILITY, TRUTH)
"""Files of Records that any page shows, if they exist."""


def stability(out: Path) -> None:
    """Compute every expression at its extremes, print the table and write the Records.

    Raises
    ------
    WorkFailed
        If an expression does not hold.
    """
    from rich.console import Console

    from reports.record import this_machine, write_records
    from reports.stability import failures, to_records
    from reports.stability import stability as findings_of

    console = Console()
    with console.status("stability") as status:
        findings = findings_of(lambda about: status.update(f"stability: {about}"))
    path = out / STABILITY
    write_records(path, to_records(findings), this_machine(1))
    console.print(_table(findings))
    console.print(f"\n{path}: {len(findings)} expressions", soft_wrap=True, highlight=False)
    if wrong := failures(findings):
        first, more = wrong[0], f"; {len(wrong) - 1} more do not hold" if len(wrong) > 1 else ""
        raise WorkFailed(
            f"stability: {first.expression} in {first.arithmetic}, {first.corner}: {first.fault} at {first.at}{more}"
        )


def truth(out: Path) -> None:
    """Measure points and queries a second, print each as it comes, and write the Records."""
    from rich.console import Console
    from rich.table import Table

    from reports.record import this_machine, write_records
    from reports.throughput import measure, to_records

    console = Console()
    rates = []
    with console.status("speed of the truth") as status:
        for rate in measure():
            rates.append(rate)
            status.update(f"speed of the truth: {rate.what} {rate.fabric}")
    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for name in ("what", "fabric", "rate", "unit", "note"):
        table.add_column(name, justify="right" if name == "rate" else "left")
    for rate in rates:
        table.add_row(rate.what, rate.fabric, f"{rate.value:,.3g}", rate.unit, rate.note)
    console.print(table)
    path = out / TRUTH
    write_records(path, to_records(rates), this_machine(1))
    console.print(f"\n{path}: {len(rates)} rates", soft_wrap=True, highlight=False)


def _table(findings: Sequence[Finding]) -> RenderableType:
    """Show findings: worst error, limit, the textbook's error, what cannot be, and where what does not hold fails."""
    from rich.table import Table

    from reports.cells import stability_rows

    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for name in ("expression", "corner", "worst", "limit", "textbook", "NaN", "< 0", ""):
        table.add_column(name, justify="left" if name in ("expression", "corner", "") else "right")
    for arithmetic, rows in stability_rows(findings).items():
        table.add_section()
        table.add_row(f"[bold]{arithmetic}")
        for row in rows:
            where = "" if row["holds"] else f"\nat {row['at']}"
            table.add_row(row["expression"], f"{row['corner']}{where}", *row["cells"], row["verdict"])
    return table


BENCHES: Final[dict[str, Callable[[Path], None]]] = {"stability": stability, "truth": truth}
"""Measurements by name; no recipe of such a name can be asked for."""
