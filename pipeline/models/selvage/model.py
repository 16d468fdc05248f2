"""Soft nodes of the level that each query needs, or the fallback, by their expected errors (`errors`).

    error   the cheapest answer whose expected error is at most the wished one; the best one if there is none
    time    the answers of least summed squared error whose mean time on this machine is at most the wished one

Errors are root mean squares over many queries, relative to a grey cloth's colour: single errors may be larger. The
fallback sees rims: another meaning of walls is answered by soft nodes alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import ClassVar, Final

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.models.analytic.soft_nodes import Level, SoftNodes
from pipeline.models.fallback import fallback_answers
from pipeline.models.method import refuse_other
from pipeline.models.selvage import USUAL_ERROR, SelvageOptions
from pipeline.models.selvage.choice import Chosen, within_error, within_time
from pipeline.models.selvage.costs import kinds_of, seconds_of
from pipeline.models.selvage.errors import coefficients_of, logarithms
from pipeline.per_fabric import PerFabric
from pipeline.truth.options import Walls
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

LEVELS: Final[tuple[Level, ...]] = (1, 2, 4, 8)
"""Levels of detail of its soft nodes, from the cheapest on."""

_ANY = Queries.round(u=[0.5], v=[0.5], sigma=[1.0], wi=[[0.6, 0.0, 0.8]], wo=[[0.0, 0.0, 1.0]])


class Selvage:
    """Answers within a wished error or time.

    Parameters
    ----------
    error : float
        Wished relative error where a query names neither error nor time, above 0 and below 1.
    name : str
        Name of the method.
    walls : {"left_out", "rim"}
        What view rays see that meet a wall.
    """

    turns: ClassVar[bool] = SelvageOptions.turns
    asked: ClassVar[bool] = True

    def __init__(self, error: float = USUAL_ERROR, name: str = "selvage", walls: Walls = "rim") -> None:
        self.name, self.setting, self.error = name, SelvageOptions.setting_of(error), error
        self._nodes = [SoftNodes(level, name, walls) for level in LEVELS]
        self._answers: list[Callable[[Fabric, Queries, int], Float32]] = [node.predict for node in self._nodes]
        if walls == "rim":
            self._answers.append(fallback_answers)
        self._coefficients = PerFabric(coefficients_of)

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric can be tabulated."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric for all that answers it, flat and lit from the front, once."""
        self._coefficients.of(fabric)
        for answer in self._answers:
            answer(fabric, _ANY, 0)

    def predict(
        self, fabric: Fabric, queries: Queries, seed: int = 0, error: float | None = None, time: float | None = None
    ) -> Float32:
        """Answer N queries, float32 (N, 4).

        Parameters
        ----------
        fabric : Fabric
            The cloth.
        queries : Queries
            N queries from a viewer in front.
        seed : int
            Seed of the fallback's random points.
        error : float, optional
            Wished relative error of the colour, root mean square, above 0 and below 1.
        time : float, optional
            Wished mean seconds of a query on one thread of this machine. What is chosen then depends on the machine.

        Raises
        ------
        BadInput
            If viewers are behind the cloth, both are wished, or a wish is out of its range.
        """
        chosen, result = self.choose(fabric, queries, error, time), np.empty((len(queries.u), 4), np.float32)
        for index, answer in enumerate(self._answers):
            rows = np.flatnonzero(chosen == index)
            if len(rows):
                result[rows] = answer(fabric, queries.take(rows), seed)
        return result

    def choose(self, fabric: Fabric, queries: Queries, error: float | None = None, time: float | None = None) -> Chosen:
        """Return which answer each of N queries gets, (N,): a level of soft nodes by its place, 4 the fallback."""
        refuse_other(queries, f"the method {self.name} answers", SelvageOptions().kinds)
        self._refuse(error, time)
        if time is None:
            return within_error(queries, self._of(fabric), self.error if error is None else error)
        kinds = kinds_of(queries)
        seconds = seconds_of(kinds, self._answers, fabric)
        least = float(seconds[kinds].min(axis=1).mean()) if len(kinds) else 0.0
        if time < least:
            allowed = f"these queries take at least {least:.2g} seconds each on this machine"
            raise BadInput(self.name, "time", time, allowed)
        return within_time(logarithms(queries, self._of(fabric)), kinds, seconds, time)

    def expected_errors(self, fabric: Fabric, queries: Queries) -> Float32:
        """Return the expected relative errors of all answers to N queries, root mean squares, (N, answers)."""
        return np.asarray(np.exp(0.5 * logarithms(queries, self._of(fabric))), np.float32)

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the transparency of N footprints, float32 (N,), by soft nodes."""
        return self._nodes[1].transparency(fabric, looks)

    def coverage(self, fabric: Fabric, looks: Queries) -> Float32:
        """Return the share of view rays that do not leave curved cloth again, float32 (N,), as soft nodes do."""
        return self._nodes[1].coverage(fabric, looks)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the tables of all levels and of the errors; all methods share those of the fallback."""
        return sum(node.bytes_stored(fabric) for node in self._nodes) + self._coefficients.of(fabric).nbytes

    def _of(self, fabric: Fabric) -> Float32:
        """Return the coefficients of the answers at hand, (cases, answers, TERMS)."""
        return self._coefficients.of(fabric)[:, : len(self._answers)]

    def _refuse(self, error: float | None, time: float | None) -> None:
        """Refuse both wishes at once, and one that is out of its range."""
        if error is not None and time is not None:
            raise BadInput(self.name, "time", time, "leave out time or error: only one of them can be wished")
        if error is not None and not 0.0 < error < 1.0:
            raise BadInput(self.name, "error", error, "a relative error above 0 and below 1 is needed, such as .02")
        if time is not None and not 0.0 < time < math.inf:
            raise BadInput(self.name, "time", time, "seconds a query above 0 are needed, such as 5e-6")
