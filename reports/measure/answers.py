"""Errors of answers that were handed in as numbers: the same Records as of a method that answers here.

Components are measured as any method's. Of RGB there is the MSE in the fabric's own colours, and nothing else: it can
be compared with the truth in these colours alone.
"""

from collections.abc import Sequence

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.scenes.shade import coloured, colours_of
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.query import Queries
from reports.error import colour_noise, squared_error
from reports.measure.by_size import measure_errors_by_size
from reports.measure.held_out import HeldOutFabric, measure_errors
from reports.options import ErrorOptions, Role
from reports.record import Record
from weaves.fabric import Fabric


class HandedIn:
    """A method that answers the held-out queries of some fabrics, each with its row of what was handed in."""

    setting = ""

    def __init__(self, name: str, parts: Sequence[tuple[HeldOutFabric, Float32]]) -> None:
        self.name = name
        self._answers = {
            rows.fabric.name: dict(zip(_keys(rows.queries), answers, strict=True)) for rows, answers in parts
        }

    def covers(self, fabric: Fabric) -> bool:
        """Return whether there are answers about a fabric."""
        return fabric.name in self._answers

    def prepare(self, fabric: Fabric) -> None:
        """Do nothing."""

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Return the answers to N of the queries, float32 (N, 4)."""
        known = self._answers[fabric.name]
        return np.stack([known[key] for key in _keys(queries)])

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return 0: what the method stores elsewhere is stated."""
        return 0


def measure_answers(
    subject: Record,
    answers: Float32,
    rows: Sequence[HeldOutFabric],
    roles: Sequence[Role],
    named: int,
    options: ErrorOptions,
) -> list[Record]:
    """Measure answers to all held-out queries, (N, 4) components or (N, 3) RGB, in the order of the fabrics.

    Errors are of each fabric, as `measure_errors` has them; by the size of footprints, of the first `named` fabrics
    together. Records have the name and the origin of the subject, and the roles of the fabrics.
    """
    ends = np.cumsum([len(part.queries.u) for part in rows])
    parts = list(zip(rows, np.split(answers, ends[:-1]), strict=True))
    records = []
    for (held_out, values), role in zip(parts, roles, strict=True):
        first = slice(options.rows)
        some = held_out._replace(queries=held_out.queries.take(first), truth=held_out.truth.take(first))
        if answers.shape[1] == len(COMPONENTS):
            measured = measure_errors(HandedIn(subject.method, [(some, values[first])]), some, options.seed)
        else:
            colours = colours_of(some.fabric, some.queries)
            truth, noise = coloured(some.truth.mean, colours), colour_noise(some.truth, colours)
            of_fabric = subject.model_copy(update={"fabric": some.fabric.name, "scene": "queries"})
            measured = of_fabric.of_error(squared_error(values[first], truth, noise))
        records += [record.model_copy(update={"role": role}) for record in measured]
    if answers.shape[1] == len(COMPONENTS):
        records += measure_errors_by_size([HandedIn(subject.method, parts[:named])], rows[:named], options.seed)
    return [record.model_copy(update={"provenance": subject.provenance}) for record in records]


def _keys(queries: Queries) -> list[bytes]:
    """Return the bytes of each query, by which its answer is found."""
    return [row.tobytes() for row in np.column_stack(queries)]
