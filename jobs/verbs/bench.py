"""`twillight bench`: measurements without a recipe: `stability`, `truth`, `sampler` and `mitsuba`.

Their Records lie beside those of the recipes, and the next page shows them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeVar

from jobs.run.cluster import HERE, Scheduler
from pipeline.fingerprint import file_sha256
from pipeline.storage import is_file
from weaves.errors import BadInput, WorkFailed

if TYPE_CHECKING:
    from rich.console import RenderableType

    from reports.truth.finding import Finding
    from reports.truth.row_records import RowRecords

Measurement = TypeVar("Measurement")

STABILITY: Final = "records/stability.json"
"""File of the Records of `bench stability`, under the folder of all products."""

TRUTH: Final = "records/truth.json"
"""File of the Records of `bench truth`."""

SAMPLER: Final = "records/sampler.json"
"""File of the Records of `bench sampler`."""

MITSUBA: Final = "records/mitsuba.json"
"""File of the Records of `bench mitsuba`."""

RECORDS: Final = (STABILITY, TRUTH, SAMPLER, MITSUBA)
"""Files of Records that every page shows, if they exist."""


def measured_alone(out: Path) -> dict[str, str]:
    """Return the files of `RECORDS` that exist, each with its hash: they are inputs of a page."""
    return {path: file_sha256(out / path) for path in RECORDS if is_file(out / path)}


def bench_alone(name: str, out: Path, scheduler: Scheduler = HERE, workers: int = 0, progress: str = "auto") -> None:
    """Run one of `BENCHES`.

    Raises
    ------
    BadInput
        If a scheduler, workers or a form of progress are given.
    WorkFailed
        If an expression exceeds its limit.
    """
    own = "" if progress == "auto" else progress
    for option, value in (("--scheduler", scheduler.address), ("--workers", workers), ("--progress", own)):
        if value:
            raise BadInput(f"bench {name}", option, value, "leave it out: the measurement runs in this process")
    BENCHES[name](out)


def stability(out: Path) -> None:
    """Compute every expression at its extremes, print the table and write the Records.

    Raises
    ------
    WorkFailed
        If an expression does not hold.
    """
    from jobs.terminal import Terminal
    from reports.record import this_machine, write_records
    from reports.truth.finding import RECORDS, failures
    from reports.truth.stability import stability as findings_of

    console = Terminal()
    with console.status("stability") as status:
        findings = findings_of(lambda about: status.update(f"stability: {about}"))
    path = out / STABILITY
    write_records(path, RECORDS.to_records(findings), this_machine(1))
    console.print(_table(findings))
    console.print(f"\n{path}: {len(findings)} expressions", soft_wrap=True)
    if wrong := failures(findings):
        first, more = wrong[0], f"; {len(wrong) - 1} more do not hold" if len(wrong) > 1 else ""
        raise WorkFailed(
            f"stability: {first.expression} in {first.arithmetic}, {first.corner}: {first.fault} at {first.at}{more}"
        )


def truth(out: Path) -> None:
    """Measure speed, accuracy, calibration, bias, effort and colours; print the tables and write the Records."""
    from jobs.terminal import Terminal
    from reports.record import this_machine, write_records
    from reports.tables import truth_rows
    from reports.truth import accuracy, bias, calibration, effort, footprint_colours, throughput

    console = Terminal()
    with console.status("the truth") as status:

        def all_of(about: str, found: Iterable[Measurement]) -> list[Measurement]:
            result = []
            status.update(f"the truth: {about}")
            for one in found:
                result.append(one)
                status.update(f"the truth: {about}, {len(result)} numbers")
            return result

        rates = all_of("speed", throughput.measure())
        accuracies = all_of("accuracy", accuracy.measure())
        calibrations = all_of("calibration of errors", calibration.measure())
        biases = all_of("bias", bias.measure())
        efforts = all_of("effort", effort.measure())
        losses = all_of("colours of threads", footprint_colours.measure())
    records = throughput.RECORDS.to_records(rates) + accuracy.RECORDS.to_records(accuracies)
    records += calibration.RECORDS.to_records(calibrations)
    records += bias.RECORDS.to_records(biases) + effort.RECORDS.to_records(efforts)
    records += footprint_colours.RECORDS.to_records(losses)
    path = out / TRUTH
    write_records(path, records, this_machine(1))
    console.print(_columns(("what", "fabric", "rate", "note"), truth_rows.rate_rows(records)))
    for fabric, rows in truth_rows.accuracy_rows(accuracies).items():
        console.print(_columns((fabric, *truth_rows.ACCURACY), rows))
    console.print(_columns(("estimator", *truth_rows.CALIBRATION), truth_rows.calibration_rows(calibrations)))
    console.print(_columns(("fabric", *truth_rows.BIAS), truth_rows.bias_rows(biases)))
    console.print(_columns(("fabric", *truth_rows.EFFORT), truth_rows.effort_rows(efforts)))
    console.print(_columns(("fabric", *truth_rows.COLOURS), truth_rows.colour_rows(losses)))
    console.print(f"\n{path}: {len(records)} records", soft_wrap=True)


def sampler(out: Path) -> None:
    """Measure the variance that importance sampling saves, also in equal time; print and write the Records."""
    from reports.tables.truth_rows import SAMPLERS, sampler_rows
    from reports.truth.sampling import RECORDS, Saving, measure

    def title(one: Saving) -> str:
        return f"the sampler: {one.fabric}, {one.sampler}"

    _one_table(out / SAMPLER, measure(), title, RECORDS, ("fabric", *SAMPLERS), sampler_rows)


def mitsuba(out: Path) -> None:
    """Measure error and time of path-traced frames; print and write the Records."""
    from reports.tables.truth_rows import TRACED, traced_rows
    from reports.truth.path_traced import RECORDS, Traced, measure

    def title(one: Traced) -> str:
        return f"frames in Mitsuba: {one.fabric}, {one.method}, {one.samples} samples"

    _one_table(out / MITSUBA, measure(), title, RECORDS, ("scene", *TRACED), traced_rows)


def _one_table(
    path: Path,
    measured: Iterable[Measurement],
    title: Callable[[Measurement], str],
    kept: RowRecords[Measurement],
    columns: Sequence[str],
    rows: Callable[[Sequence[Measurement]], list[list[str]]],
) -> None:
    """Show what is measured, one `title` after the other; then write the Records and print the table."""
    from jobs.terminal import Terminal
    from reports.record import this_machine, write_records

    console, found = Terminal(), []
    with console.status("measuring") as status:
        for one in measured:
            found.append(one)
            status.update(title(one))
    records = kept.to_records(found)
    write_records(path, records, this_machine(1))
    console.print(_columns(columns, rows(found)))
    console.print(f"\n{path}: {len(records)} records", soft_wrap=True)


def _columns(names: Sequence[str], rows: Sequence[Sequence[str]]) -> RenderableType:
    """Show rows of cells, each table after an empty line."""
    from rich.padding import Padding
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for name in names:
        text = name == names[0] or name in ("fabric", "rate", "note", "light", "how", "method")
        table.add_column(name, justify="left" if text else "right")
    for row in rows:
        table.add_row(*row)
    return Padding(table, (1, 0, 0, 0))


def _table(findings: Sequence[Finding]) -> RenderableType:
    """Return findings as a table: worst error, limit, the textbook's error, invalid values, inputs of failures."""
    from rich.table import Table

    from reports.tables.truth_rows import stability_rows

    table = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 1, 0, 0))
    for name in ("expression", "corner", "worst", "limit", "textbook", "NaN", "< 0", ""):
        table.add_column(name, justify="left" if name in ("expression", "corner", "") else "right")
    for arithmetic, rows in stability_rows(findings).items():
        table.add_section()
        table.add_row(arithmetic, style="bold")
        for row in rows:
            where = "" if row["holds"] else f"\nat {row['at']}"
            table.add_row(row["expression"], f"{row['corner']}{where}", *row["cells"], row["result"])
    return table


BENCHES: Final[dict[str, Callable[[Path], None]]] = {
    "stability": stability,
    "truth": truth,
    "sampler": sampler,
    "mitsuba": mitsuba,
}
"""Measurements by name; no recipe has such a name."""
