"""Soft nodes of the level that each query needs, or the fallback, by their expected errors (`errors`).

    error   the answers of least time whose root mean square error over footprints of all sizes is the wished one
    time    the answers of least error whose mean time on this machine is at most the wished one

Errors are relative to a grey cloth's colour. Those of narrow footprints and low views are larger than those of others
(`expected_errors`); a wish below the errors of all answers gets the best ones. The fallback sees rims: another meaning
of walls is answered by soft nodes alone.
"""

from collections.abc import Callable
from functools import partial
from typing import ClassVar

import numpy as np

from pipeline.compiled.arrays import Float32, Float64
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.fallback import fallback_answers
from pipeline.models.method import refuse_other
from pipeline.models.selvage import choice
from pipeline.models.selvage.cloth_numbers import NODE_LEVELS, probes
from pipeline.models.selvage.errors import CASES, CURVED, RANGES, coefficients_of, expected, squares_and_kinds
from pipeline.models.selvage.wish import USUAL_ERROR, refuse_wishes, text_of
from pipeline.per_fabric import PerFabric
from pipeline.truth.options import Walls
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

_ANY = Queries.round(u=[0.5], v=[0.5], sigma=[1.0], wi=[[0.6, 0.0, 0.8]], wo=[[0.0, 0.0, 1.0]])


class Selvage:
    """Answers within a wished error or time.

    `error`, above 0 and below 1, is the wished relative error where a query names neither error nor time; view rays
    that meet a wall see `walls`.
    """

    turns: ClassVar[bool] = True
    takes_wishes: ClassVar[bool] = True

    def __init__(self, error: float = USUAL_ERROR, name: str = "selvage", walls: Walls = "rim") -> None:
        self.name, self.setting, self.error = name, text_of(error), error
        self._curves = {behind: PerFabric(partial(self._error_curves, behind=behind)) for behind in (False, True)}
        self._nodes = [SoftNodes(level, name, walls) for level in NODE_LEVELS]
        self._answers: list[Callable[[Fabric, Queries, int], Float32]] = [node.predict for node in self._nodes]
        if walls == "rim":
            self._answers.append(fallback_answers)
        self._seconds = 1e-6 * np.array(expected("microseconds"))[:, : len(self._answers)]

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric can be tabulated."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric for all that answers it, flat and lit from the front, once."""
        self._curves[False].of(fabric)
        for answer in self._answers:
            answer(fabric, _ANY, 0)

    def predict(
        self, fabric: Fabric, queries: Queries, seed: int = 0, error: float | None = None, time: float | None = None
    ) -> Float32:
        """Answer N queries from a viewer in front, float32 (N, 4); `seed` is that of the fallback's random points.

        `error` is the wished relative error of the colour, root mean square, above 0 and below 1; `time` the wished
        mean seconds of a query on one thread of this machine, on which the choice then depends. BadInput if viewers are
        behind the cloth, both are wished, or a wish is out of its range.
        """
        chosen = self.choose(fabric, queries, error, time)
        order, ends = np.argsort(chosen, kind="stable"), np.bincount(chosen).cumsum().tolist()
        ordered, answers = queries.take(order), np.empty((len(order), 4), np.float32)
        for answer, start, end in zip(self._answers, [0, *ends], ends, strict=False):
            if start < end:
                answers[start:end] = answer(fabric, ordered.take(slice(start, end)), seed)
        return answers.take(np.argsort(order), axis=0)

    def choose(
        self, fabric: Fabric, queries: Queries, error: float | None = None, time: float | None = None
    ) -> choice.Chosen:
        """Return which answer each of N queries gets, (N,): a level of soft nodes by its place, 5 the fallback."""
        refuse_other(queries, f"the method {self.name} answers", ("stretch", "behind", "curvature"))
        refuse_wishes(self.name, error, time)
        squares, kinds = squares_and_kinds(queries, self._coefficients(fabric, queries))
        if time is None:
            curves, wish = self._curves[_behind(queries)].of(fabric), self.error if error is None else error
            prices = np.repeat([choice.price_of(curve, wish) for curve in curves], RANGES)
            return choice.choose_at(squares, kinds, prices[:, None] * self._seconds)
        seconds = choice.seconds_of(kinds, self._answers, fabric)
        least = float(seconds.min(axis=1)[kinds].mean()) if len(kinds) else 0.0
        if time < least:
            raise BadInput(self.name, "time", time, f"these queries take at least {least:.2g} s each on this machine")
        return choice.within_time(squares, kinds, seconds, time)

    def expected_errors(self, fabric: Fabric, queries: Queries) -> Float32:
        """Return the expected relative errors of all answers to N queries, root mean squares, (N, answers)."""
        return np.sqrt(squares_and_kinds(queries, self._coefficients(fabric, queries))[0].T)

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the transparency of N footprints, float32 (N,), by soft nodes."""
        return self._nodes[NODE_LEVELS.index(2)].transparency(fabric, looks)

    def coverage(self, fabric: Fabric, looks: Queries) -> Float32:
        """Return the share of view rays that do not leave curved cloth again, float32 (N,), as soft nodes do."""
        return self._nodes[NODE_LEVELS.index(2)].coverage(fabric, looks)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the tables of all levels and of the errors; all methods share those of the fallback."""
        return sum(node.bytes_stored(fabric) for node in self._nodes) + coefficients_of(fabric, False).nbytes

    def _coefficients(self, fabric: Fabric, queries: Queries) -> Float32:
        """Return the coefficients of the answers at hand, as `coefficients_of`."""
        return coefficients_of(fabric, _behind(queries))[:, : len(self._answers)]

    def _error_curves(self, fabric: Fabric, behind: bool) -> list[Float64]:
        """Return the curve of errors over prices of each case; those of light from behind only if it is wanted."""
        coefficients = coefficients_of(fabric, behind)[:, : len(self._answers)]
        curves = []
        for case in range(CASES):
            queries = probes(fabric, bool(case % 2) and behind, case >= CURVED, directions=("projected_disc",))
            curves.append(choice.error_curve(*squares_and_kinds(queries, coefficients), self._seconds))
        return curves


def _behind(queries: Queries) -> bool:
    """Return whether any light is behind the cloth."""
    return bool((queries.wi[:, 2] < 0.0).any())
