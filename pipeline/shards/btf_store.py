"""A synthetic BTF on disk: Parquet with page checksums, written whole or not at all, the same bytes for the same rows.

One row is one texel: its footprint, and `samples`, a list of records (wi, wo, linear RGB, standard error). A list of
records rather than a row for every sample: a texel is what an encoder reads at once, so no cut of the file, row group
or slice can part its samples; its footprint is stored once; a texel may hold none; and columns within one record cannot
differ in length. The file carries a SHA-256 of its facts and values, so that damage to the footer, which Parquet gives
no checksum, is noticed as well.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.atomic import atomic_path
from pipeline.fingerprint import canonical
from weaves.errors import BadInput

SCHEMA_VERSION: Final = 1
_KEY, _DIGEST = b"twillight_btf", b"sha256"
_ROW_GROUP = 1024

_TEXEL: Final = {
    "u": "centre of the texel along x (weft direction), yarn spacings",
    "v": "centre of the texel along y (warp direction), yarn spacings",
    "sigma": "standard deviation of the texel's footprint, yarn spacings, > 0",
}
_SAMPLE: Final = {
    **{f"wi_{axis}": "unit vector to the light" for axis in "xyz"},
    **{f"wo_{axis}": "unit vector to the viewer" for axis in "xyz"},
    **{name: f"patch BSDF, linear {name}, incident cosine included, 1/sr" for name in ("red", "green", "blue")},
    **{f"{name}_standard_error": f"standard error of {name}" for name in ("red", "green", "blue")},
}


def _field(name: str, kind: pa.DataType, meaning: str) -> pa.Field:
    return pa.field(name, kind, nullable=False, metadata={"meaning": meaning})


_RECORD: Final = pa.struct([_field(name, pa.float32(), meaning) for name, meaning in _SAMPLE.items()])
SCHEMA: Final = pa.schema(
    [
        *(_field(name, pa.float32(), meaning) for name, meaning in _TEXEL.items()),
        _field("samples", pa.list_(pa.field("element", _RECORD, nullable=False)), "angular samples, any number"),
    ]
)
"""Arrow schema of a synthetic BTF, each column with its meaning."""


class Btf(NamedTuple):
    """T texels with S samples in all; the samples of texel t are rows offsets[t] to offsets[t + 1].

    Attributes
    ----------
    u, v, sigma : float32 (T,)
        Footprint of each texel, in yarn spacings.
    offsets : int64 (T + 1,)
        Where the samples of each texel begin.
    wi, wo : float32 (S, 3)
        Directions to light and viewer.
    rgb, standard_error : float32 (S, 3)
        Linear patch BSDF, incident cosine included, 1/sr, and its standard error.
    """

    u: npt.NDArray[np.float32]
    v: npt.NDArray[np.float32]
    sigma: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.int64]
    wi: npt.NDArray[np.float32]
    wo: npt.NDArray[np.float32]
    rgb: npt.NDArray[np.float32]
    standard_error: npt.NDArray[np.float32]

    def texel(
        self, index: int
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Return wi, wo, rgb, standard_error (n, 3) of the texel in row `index`."""
        rows = slice(int(self.offsets[index]), int(self.offsets[index + 1]))
        return self.wi[rows], self.wo[rows], self.rgb[rows], self.standard_error[rows]


def write_btf(path: Path, btf: Btf, about: dict[str, Any]) -> None:
    """Write texels and JSON-able facts to `path`, whole or not at all."""
    facts = canonical({"schema_version": SCHEMA_VERSION, **about})
    values = np.concatenate([btf.wi, btf.wo, btf.rgb, btf.standard_error], axis=1).T
    records = pa.StructArray.from_arrays([pa.array(column) for column in values], fields=list(_RECORD))
    lists = pa.ListArray.from_arrays(btf.offsets.astype(np.int32), records, type=SCHEMA.field("samples").type)
    metadata = {_KEY: facts, _DIGEST: _digest(facts, btf)}
    table = pa.Table.from_arrays([*map(pa.array, btf[:3]), lists], schema=SCHEMA.with_metadata(metadata))
    with atomic_path(path) as temporary:
        pq.write_table(
            table,
            temporary,
            row_group_size=_ROW_GROUP,
            compression="zstd",
            use_dictionary=False,
            use_byte_stream_split=[*_TEXEL, *(f"samples.list.element.{name}" for name in _SAMPLE)],
            write_page_checksum=True,
        )


def _digest(facts: bytes, btf: Btf) -> bytes:
    """Return the SHA-256 of facts and values, in hexadecimal."""
    whole = hashlib.sha256(facts)
    for column in btf:
        whole.update(np.ascontiguousarray(column).tobytes())
    return whole.hexdigest().encode()


def read_btf(path: Path) -> tuple[Btf, dict[str, Any]]:
    """Read a synthetic BTF and the facts stored with it, everything verified.

    Raises
    ------
    BadInput
        If the file is missing, cut short, damaged, or not a BTF of this schema.
    """
    try:
        table = pq.read_table(path, page_checksum_verification=True, memory_map=False)
        names, metadata = ", ".join(table.schema.names), table.schema.metadata or {}
        btf = _decoded(table) if table.schema.equals(SCHEMA, check_metadata=False) else None
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", "generate the BTF first") from error
    except (pa.ArrowException, OSError, ValueError, MemoryError) as error:
        reason = (str(error).splitlines() or ["damaged"])[0].rstrip(".")
        raise BadInput(str(path), "", f"not a whole Parquet file ({reason})", "delete it and generate it") from error
    if btf is None or not {_KEY, _DIGEST} <= metadata.keys():
        raise BadInput(str(path), "schema", names, f"must be a synthetic BTF, version {SCHEMA_VERSION}")
    if metadata[_DIGEST] != _digest(metadata[_KEY], btf):
        reason = "its values are not those that were written (SHA-256 differs)"
        raise BadInput(str(path), "", reason, "delete it and generate it")
    facts: dict[str, Any] = json.loads(metadata[_KEY])
    return btf, facts


def _decoded(table: pa.Table) -> Btf:
    """Return the arrays of a table of this schema."""
    lists = table.column("samples").combine_chunks()
    values = [column.to_numpy() for column in lists.flatten().flatten()]
    wi, wo, rgb, error = (np.stack(values[k : k + 3], axis=-1) for k in (0, 3, 6, 9))
    u, v, sigma = (table.column(name).to_numpy() for name in _TEXEL)
    lengths = lists.value_lengths().to_numpy()
    return Btf(u, v, sigma, np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64), wi, wo, rgb, error)
