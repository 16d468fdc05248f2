"""Measured BSDFs as files: Klems XML, or Parquet with one value a row.

A row of the Parquet form is one pair of patches of a Klems basis. Its columns are `kind` (reflection, transmission),
`side` (the face that the light meets), `theta_in`, `phi_in`, `theta_out`, `phi_out` (degrees, the middles of the
patches, labels as in Klems files) and `value` (1/sr, without the cosine). Pairs that are left out are not known.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from pipeline.bsdf.klems import BASES, FACES, SCATTERED, Basis, Scattering
from pipeline.bsdf.klems_xml import mirrored, read_klems
from pipeline.compiled.arrays import Float64, Index
from pipeline.shards.query_file import open_queries
from weaves.errors import BadInput

COLUMNS_NEEDED: Final = ("kind", "side", "theta_in", "phi_in", "theta_out", "phi_out", "value")
"""Columns of the Parquet form; others are ignored."""

_MOST_ROWS: Final = 4 * 145 * 145
_TOLERANCE: Final = 0.01  # degrees


def read_bsdf(path: Path) -> Scattering:
    """Read a measured BSDF, ``.xml`` or ``.parquet``; the latter has the band ``visible``.

    BadInput if the file is missing or damaged, has another basis, lacks columns, or sends on more light than arrives.
    """
    try:
        if path.suffix == ".xml":
            return read_klems(path)
        return _read_parquet(path).checked(str(path))
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "no such file", "the path of a BSDF, .xml or .parquet, is needed") from error


def _read_parquet(path: Path) -> Scattering:
    where = str(path)
    with open_queries(path) as file:
        if missing := [name for name in COLUMNS_NEEDED if name not in file.schema_arrow.names]:
            raise BadInput(
                where, "", f"columns missing: {', '.join(missing)}", f"{', '.join(COLUMNS_NEEDED)} are needed"
            )
        if not 0 < file.metadata.num_rows <= _MOST_ROWS:
            raise BadInput(where, "rows", file.metadata.num_rows, f"1 to {_MOST_ROWS} are needed")
        table = file.read(columns=list(COLUMNS_NEEDED))
    kind, side = (_numbers(where, table, *names) for names in (("kind", SCATTERED), ("side", FACES)))
    angles = {name: _column(where, table, name) for name in COLUMNS_NEEDED[2:]}
    for basis in BASES.values():
        out, into = (_patches(basis, angles[f"theta_{end}"], angles[f"phi_{end}"]) for end in ("out", "in"))
        if min(out.min(), into.min()) >= 0:
            break
    else:
        raise BadInput(where, "theta_in, phi_in", "no patch", f"middles of patches are needed: {', '.join(BASES)}")
    blocks = np.full((2, 2, basis.patches, basis.patches), np.nan)
    blocks[kind, side, out, into] = angles["value"]
    return Scattering(basis, {"visible": mirrored(basis, blocks)})


def _numbers(where: str, table: Any, name: str, known: tuple[str, str]) -> Index:
    """Return the numbers of words of a column, (N,)."""
    words = table[name].to_pylist()
    if strange := set(words) - set(known):
        raise BadInput(where, name, strange.pop(), f"must be {' or '.join(known)}")
    return np.array([known.index(word) for word in words])


def _column(where: str, table: Any, name: str) -> Float64:
    values = table[name].to_numpy()
    if values.dtype.kind not in "fiu":
        raise BadInput(where, f"type of column {name}", str(table.schema.field(name).type), "numbers are needed")
    if not np.isfinite(values).all():
        raise BadInput(where, name, "not a finite number", "finite numbers are needed")
    return np.asarray(values, np.float64)


def _patches(basis: Basis, theta: Float64, phi: Float64) -> Index:
    """Return the patch of each pair of angles, (N,); -1 if they are the middle of none."""
    middles = np.mean([basis.bounds[:-1], basis.bounds[1:]], axis=0)
    middles[0] = 0.0
    ring = np.abs(theta[:, None] - middles).argmin(axis=1)
    counts = np.array(basis.counts)[ring]
    turn = phi * counts / 360.0
    patch = np.concatenate([[0], np.cumsum(basis.counts)[:-1]])[ring] + np.round(turn).astype(int) % counts
    good = (np.abs(theta - middles[ring]) < _TOLERANCE) & (np.abs(turn - np.round(turn)) < _TOLERANCE)
    return np.asarray(np.where(good, patch, -1))
