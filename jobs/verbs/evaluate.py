"""`twillight evaluate`: options from the command line, a progress bar, and a summary."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from jobs.console import number, table_of
from jobs.run.cluster import MOST_WORKERS
from jobs.terminal import Terminal
from pipeline.cores import cores
from pipeline.shards.evaluate import Answerer, Summary, bad_list, evaluate_file
from pipeline.truth.estimator import ESTIMATORS
from pipeline.truth.options import TruthOptions
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric
from weaves.validation import validated

WHERE = "evaluate"


def truth_options(**chosen: object) -> TruthOptions:
    """Return the options of the truth from the command line; those not given have their defaults.

    Raises
    ------
    BadInput
        If one cannot be used, named as it is spelt on the command line.
    """
    given = {name: value for name, value in chosen.items() if value is not None}
    estimator = given.get("estimator", TruthOptions().estimator)
    if estimator not in ESTIMATORS:
        raise BadInput(WHERE, "--estimator", estimator, nearest(str(estimator), ESTIMATORS))
    try:
        return validated(TruthOptions, given, WHERE)
    except BadInput as error:
        if not error.key:
            raise
        raise BadInput(WHERE, f"--{error.key.replace('_', '-')}", error.value, error.allowed) from error


def evaluate(
    fabric: Fabric,
    queries: Path,
    out: Path,
    options: TruthOptions,
    seed: int,
    workers: int,
    skip_bad: bool,
    other: Answerer | None = None,
) -> None:
    """Evaluate the queries of a file on some threads (0: one per core) and print a summary.

    `other`, if given, replaces the ground truth; torch then computes on the threads that call it.

    Raises
    ------
    BadInput
        As `pipeline.shards.evaluate.evaluate_file`, and if the seed or the number of threads cannot be used.
    """
    if not 0 <= workers <= MOST_WORKERS:
        raise BadInput(WHERE, "--workers", workers, f"must be from 0 (one per core) to {MOST_WORKERS}")
    if not 0 <= seed < 2**64:
        raise BadInput(WHERE, "--seed", seed, "must be from 0 to 2^64 - 1")
    console = Terminal(stderr=True)
    columns = TextColumn("evaluating"), BarColumn(), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()
    bars = Progress(*columns, console=console, disable=not console.is_terminal, transient=True)
    with bars, _one_thread_each(other):
        bar = bars.add_task("evaluating", total=1.0)
        try:
            summary = evaluate_file(
                fabric,
                queries,
                out,
                options,
                seed,
                skip_bad,
                threads=workers or cores(),
                progress=lambda share: bars.update(bar, completed=share),
                other=other,
            )
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"stopped; {out} was not written") from None
    Terminal().print(evaluation_table(summary))
    Terminal().print(str(out), soft_wrap=True)
    if summary.bad:
        rows = "1 bad row has" if summary.bad == 1 else f"{summary.bad:,} bad rows have"
        note = f"{rows} no answer; see {bad_list(out)}"
        Terminal().print(note, soft_wrap=True)


def _one_thread_each(other: Answerer | None) -> AbstractContextManager[None]:
    """Return what keeps a model's torch on the threads that call it; the truth needs no torch."""
    if other is None:
        return nullcontext()
    from pipeline.models.method import one_thread

    return one_thread()


def evaluation_table(summary: Summary) -> Table:
    """Show the summary of `twillight evaluate`."""
    answered = summary.rows - summary.bad
    table = table_of("rows", "answered", "median relative error", "points per query", "queries per second")
    for column in table.columns:
        column.justify = "right"
    table.add_row(
        f"{summary.rows:,}",
        f"{answered:,}",
        "–"
        if summary.median_relative_error != summary.median_relative_error
        else f"{summary.median_relative_error:.2%}",
        number(summary.points / answered) if answered and summary.points else "–",
        number(answered / summary.seconds) if summary.seconds else "–",
    )
    return table
