"""`twillight evaluate`: options from the command line, a trained model in place of the truth, and a summary."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

from jobs.run.cluster import MOST_WORKERS
from jobs.terminal import number, print_lines, print_table, progress
from jobs.verbs.parameters import FabricName, Place, Whole, given, named_flags
from pipeline.cores import cores
from pipeline.shards.evaluate import Answerer, bad_list, evaluate_file, truth_answerer
from pipeline.truth.estimator import ESTIMATORS
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries, faults
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric, load_fabric
from weaves.reading import MIB, read_text
from weaves.validation import validated

_WHERE = "evaluate"


@dataclass(frozen=True)
class TruthFlags:
    """Options of the truth on the command line; None: the default of `pipeline.truth.options.TruthOptions`."""

    estimator: Annotated[str | None, Parameter(help="Estimator of the truth: auto, owen, r2, mc, …")] = None
    relative_error: Annotated[float | None, Parameter(help="Relative error at which an estimate stops.")] = None
    absolute_error: Annotated[float | None, Parameter(help="Absolute error at which it stops, in 1/sr.")] = None
    max_count: Annotated[Whole | None, Parameter(help="Most points of a row, a power of 2.")] = None
    footprint: Annotated[str | None, Parameter(help="gaussian or box.")] = None
    frame: Annotated[str | None, Parameter(help="Normal of the cosines inside the yarns: ply or macro.")] = None
    normaliser: Annotated[str | None, Parameter(help="Area in the denominator: visible or projected.")] = None
    parallax: Annotated[
        bool | None, Parameter(negative="--no-parallax", help="Footprints are patches of view rays, or of the plane.")
    ] = None
    walls: Annotated[str | None, Parameter(help="What a ray sees that meets a yarn's end: rim or left_out.")] = None


def evaluate(
    fabric: FabricName,
    queries: Annotated[Place, Parameter(help="Parquet file of queries, with the columns of a shard.")],
    *,
    out: Annotated[Place, Parameter(help="Parquet file to write.")],
    model: Annotated[
        str | None, Parameter(help="Model by name, or folder of a trained one, in place of the truth.")
    ] = None,
    extrapolate: Annotated[bool, Parameter(help="Evaluate it also for yarns outside its training domain.")] = False,
    truth: Annotated[TruthFlags, Parameter(name="*")] = TruthFlags(),
    seed: Annotated[Whole, Parameter(help="Seed of the random numbers.")] = 0,
    workers: Annotated[Whole, Parameter(help="Threads; 0: one per core.")] = 0,
    skip_bad: Annotated[bool, Parameter(help="List rows that cannot be evaluated, and continue.")] = False,
) -> None:
    """Evaluate the queries of a file, by the ground truth or a model, and print a summary.

    BadInput as `pipeline.shards.evaluate.evaluate_file`, and if an option, the model, the seed or the number of threads
    cannot be used.
    """
    chosen, cloth = given(truth), load_fabric(fabric)
    threads: AbstractContextManager[None] = nullcontext()
    if model is None:
        if "estimator" in chosen and chosen["estimator"] not in ESTIMATORS:
            raise BadInput(_WHERE, "--estimator", chosen["estimator"], nearest(chosen["estimator"], ESTIMATORS))
        with named_flags(_WHERE, _WHERE):
            answerer = truth_answerer(cloth, validated(TruthOptions, chosen, _WHERE), seed)
    else:
        from pipeline.models.network import one_thread

        threads = one_thread()
        for name, value in (chosen | ({"seed": seed} if seed else {})).items():
            allowed = "leave it out with --model: it is an option of the ground truth"
            raise BadInput(_WHERE, f"--{name.replace('_', '-')}", value, allowed)
        answerer = _model_answerer(model, cloth, extrapolate)
    if not 0 <= workers <= MOST_WORKERS:
        raise BadInput(_WHERE, "--workers", workers, f"must be from 0 (one per core) to {MOST_WORKERS}")
    if not 0 <= seed < 2**64:
        raise BadInput(_WHERE, "--seed", seed, "must be from 0 to 2^64 - 1")
    with progress("evaluating") as advance, threads:
        try:
            summary = evaluate_file(
                cloth, queries, out, answerer, skip_bad, threads=workers or cores(), progress=advance
            )
        except KeyboardInterrupt as stop:
            stop.args = (f"stopped; {out} was not written",)
            raise
    answered, error = summary.rows - summary.bad, summary.median_relative_error
    row = (
        f"{summary.rows:,}",
        f"{answered:,}",
        "–" if error != error else f"{error:.2%}",
        number(summary.points / answered) if answered and summary.points else "–",
        number(answered / summary.seconds) if summary.seconds else "–",
    )
    print_table(("rows", "answered", "median relative error", "points per query", "queries per second"), [row])
    print_lines(out)
    if summary.bad:
        rows = "1 bad row has" if summary.bad == 1 else f"{summary.bad:,} bad rows have"
        print_lines(f"{rows} no answer; see {bad_list(out)}")


def _model_answerer(model: str, fabric: Fabric, extrapolate: bool) -> Answerer:
    """Return a model prepared for a fabric; `extrapolate` accepts yarns outside the training domain."""
    from pipeline.models.card import CARD
    from pipeline.models.method import faults as faults_of
    from pipeline.models.named import loaded
    from pipeline.storage import place

    method, kinds = loaded(model, _WHERE, "--model")
    if not method.covers(fabric):
        raise BadInput(_WHERE, "--model", model, f"this model was not trained on {fabric.name}")
    domain = getattr(method, "domain", None)
    if domain is not None and not extrapolate:
        domain.refuse_fabric(fabric, method.name)
    method.prepare(fabric)
    through: Any = getattr(method, "transparency", None)

    def answer(queries: Queries, first: int) -> Answers:
        mean = method.predict(fabric, queries)
        answers = Answers.opaque(mean, np.zeros_like(mean), np.zeros(len(mean), np.int32))
        return answers._replace(transparency=through(fabric, queries)) if through else answers

    about = {"model": method.name, "setting": method.setting}
    if domain is None:
        who, rgb = f"the method {method.name} answers", hasattr(method, "own_colours")
        return Answerer(answer, about, lambda queries: faults_of(queries, who, kinds) | faults(queries), rgb=rgb)
    about["card"] = read_text(place(model, "--model") / CARD, 8 * MIB, "a model card")
    return Answerer(answer, about, lambda queries: domain.faults(queries, method.name) | faults(queries))
