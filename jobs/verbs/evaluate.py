"""`twillight evaluate`: options from the command line, a progress bar, and a summary."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from typing import Annotated

from cyclopts import Parameter
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from jobs.console import number, table_of
from jobs.run.cluster import MOST_WORKERS
from jobs.terminal import Terminal
from jobs.verbs.parameters import FabricName, Place
from pipeline.cores import cores
from pipeline.shards.evaluate import Answerer, Summary, bad_list, evaluate_file
from pipeline.truth.estimator import ESTIMATORS
from pipeline.truth.options import TruthOptions
from weaves.errors import BadInput, nearest
from weaves.fabric import load_fabric
from weaves.validation import validated

WHERE = "evaluate"


@dataclass(frozen=True)
class TruthFlags:
    """Options of the truth on the command line; None: the default of `pipeline.truth.options.TruthOptions`."""

    estimator: Annotated[str | None, Parameter(help="Estimator of the truth: auto, quadrature, owen, mc, …")] = None
    relative_error: Annotated[float | None, Parameter(help="Relative error at which an estimate stops.")] = None
    absolute_error: Annotated[float | None, Parameter(help="Absolute error at which it stops, in 1/sr.")] = None
    max_count: Annotated[int | None, Parameter(help="Most points of a row, a power of 2.")] = None
    footprint: Annotated[str | None, Parameter(help="gaussian or box.")] = None
    frame: Annotated[str | None, Parameter(help="Normal of the cosines inside the yarns: ply or macro.")] = None
    normaliser: Annotated[str | None, Parameter(help="Area in the denominator: visible or projected.")] = None


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
    fabric: FabricName,
    queries: Annotated[Place, Parameter(help="Parquet file of queries, with the columns of a shard.")],
    *,
    out: Annotated[Place, Parameter(help="Parquet file to write.")],
    model: Annotated[str | None, Parameter(help="Trained model, by name or folder, in place of the truth.")] = None,
    extrapolate: Annotated[bool, Parameter(help="Evaluate it also for yarns outside its training domain.")] = False,
    truth: Annotated[TruthFlags, Parameter(name="*")] = TruthFlags(),
    seed: Annotated[int, Parameter(help="Seed of the random numbers.")] = 0,
    workers: Annotated[int, Parameter(help="Threads; 0: one per core.")] = 0,
    skip_bad: Annotated[bool, Parameter(help="List rows that cannot be evaluated, and continue.")] = False,
) -> None:
    """Evaluate the queries of a file, by the ground truth or a model, and print a summary.

    Raises
    ------
    BadInput
        As `pipeline.shards.evaluate.evaluate_file`, and if an option, the model, the seed or the number of threads
        cannot be used.
    """
    chosen = asdict(truth)
    options, cloth, other = truth_options(**chosen), load_fabric(fabric), None
    if model is not None:
        from jobs.verbs.evaluate_model import answerer, refuse_truth_options

        refuse_truth_options(chosen | {"seed": seed or None})
        other = answerer(model, cloth, extrapolate)
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
                cloth,
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
    from pipeline.models.network import one_thread

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
