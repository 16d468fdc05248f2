"""Sums over few nodes with soft shadows: what `selvage` knows of a cloth before anything is learnt.

A cloth's table holds some tens to hundreds of nodes with normals, tangents and softened horizons (pipeline.truth.sums);
a query becomes one sum over them and costs about a microsecond. What so few nodes get wrong is a few per cent of the
answer of a wide footprint, and more of a narrow one on a patch that is hidden almost wholly.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.models.method import CHUNK
from pipeline.models.options import SumsOptions
from pipeline.models.per_fabric import PerFabric
from pipeline.truth.query import Queries
from pipeline.truth.sums.features import along_axes, read_queries
from pipeline.truth.sums.table import tabulate
from weaves.errors import BadInput
from weaves.fabric import Fabric


def refuse(queries: Queries, model: str) -> None:
    """Refuse what the sums do not know with a BadInput that names the first row and column."""
    for rows, column, value, allowed in (
        (queries.wo[:, 2] < 0, "wo", queries.wo, "viewers in front of the cloth"),
        (queries.wi[:, 2] < 0, "wi", queries.wi, "light from the viewer's side"),
        (queries.curvature > 0, "curvature", queries.curvature, "flat cloth (curvature = 0)"),
        (~along_axes(queries), "angle", queries.angle, "footprints that are round or lie along the yarns"),
    ):
        if rows.any():
            row = int(np.flatnonzero(rows)[0])
            where = f"{int(rows.sum())} rows; first row {row}: {column}"
            raise BadInput("queries", where, value[row].tolist(), f"the model {model} knows {allowed} only")


class Sums:
    """The sums alone; nothing is learnt.

    Parameters
    ----------
    name : str
        Name of the method.
    """

    def __init__(self, name: str = "sums") -> None:
        self.name, self.setting = name, ""
        self._tables = PerFabric(tabulate)

    def covers(self, fabric: Fabric) -> bool:
        """Say yes: any fabric can be tabulated."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric, once."""
        self._tables.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> npt.NDArray[np.float32]:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries the sums do not know."""
        refuse(queries, self.name)
        table = self._tables.of(fabric)
        result = np.empty((len(queries.u), 4), np.float32)
        for start in range(0, len(result), CHUNK):
            rows = slice(start, start + CHUNK)
            result[rows] = read_queries(table, queries.take(rows)).components
        return result

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the table."""
        return self._tables.of(fabric).nbytes


def restore(options: SumsOptions, trained: Sequence[tuple[dict[str, Any], Any]]) -> list[Sums]:
    """Return the method."""
    return [Sums(options.name)]
