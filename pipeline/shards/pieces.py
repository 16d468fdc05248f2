"""Rows of a whole data set: shards joined into files that others read, and all rows, generated or published, in pieces.

A joined file has the columns of the shards, but plain names of fabrics, which every reader knows, in place of an Arrow
dictionary. Its metadata say what it was made of: the same shards give the same bytes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple, get_args

import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.atomic import atomic_path
from pipeline.shards import store
from pipeline.shards.manifest import Manifest, Published, Role, Split
from pipeline.shards.schema import SCHEMA, SCHEMA_VERSION
from pipeline.storage import local_copy
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric
from weaves.reading import refuse_irregular

_JOINED: Final = SCHEMA.set(0, SCHEMA.field(0).with_type(pa.string()))


def columns_joined() -> list[tuple[str, str, str]]:
    """Return the name, the Arrow type and the meaning of every column."""
    return [(field.name, str(field.type), field.metadata[b"meaning"].decode()) for field in _JOINED]


def join_shards(path: Path, shards: Sequence[Path], about: dict[str, Any]) -> None:
    """Write the rows of shards of kind `components`, at least one, to one file in their order, whole or not at all.

    A file that is there, with the same JSON-able facts `about` it and no damaged page, is kept. BadInput if a shard is
    missing or damaged.
    """
    facts = json.dumps(about, sort_keys=True).encode()
    if _is_whole(path, facts):
        return
    schema = _JOINED.with_metadata({store.FACTS: facts})
    with atomic_path(path) as temporary, store.parquet_writer(temporary, schema, ["fabric"]) as writer:
        for table in store.regrouped(map(store.read_table, shards), store.ROW_GROUP):
            writer.write_table(table.cast(schema))


def _is_whole(path: Path, facts: bytes) -> bool:
    """Return whether a file has these facts and its pages have their checksums."""
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            if (file.schema_arrow.metadata or {}).get(store.FACTS) != facts:
                return False
            return bool(sum(len(batch) for batch in file.iter_batches(store.ROW_GROUP)) == file.metadata.num_rows)
    except (pa.ArrowException, OSError):
        return False


class RowPiece(NamedTuple):
    """Rows of one fabric and split in one file."""

    path: Path
    fabric: str
    split: str
    rows: int
    joined: bool
    """True if the file may have rows of other fabrics too."""

    def read(self) -> dict[str, npt.NDArray[Any]]:
        """Return the rows by column, without the fabric, checksums verified; BadInput for another or damaged file."""
        if not self.joined:
            return store.numbers_of(store.read_table(self.path))
        refuse_irregular(self.path, "a file of rows")
        missing = "does not exist", "get the whole data set"
        with store.readable(self.path, missing, "get the data set again"), local_copy(self.path) as file:
            table = pq.read_table(file, filters=[("fabric", "==", self.fabric)], page_checksum_verification=True)
        if table.schema.names != _JOINED.names:
            odd = ", ".join(sorted(set(table.schema.names) ^ set(_JOINED.names)))
            allowed = f"must be schema version {SCHEMA_VERSION}"
            raise BadInput(str(self.path), "schema", f"columns {odd} differ", allowed)
        if table.num_rows != self.rows:
            wrong = f"has {table.num_rows:,} rows of {self.fabric}"
            raise BadInput(str(self.path), "", wrong, f"{self.rows:,} are needed")
        return store.numbers_of(table)


class DatasetRows(NamedTuple):
    """Fabrics and pieces of a data set in a folder."""

    folder: Path
    fabrics: dict[str, Fabric]
    roles: dict[Role, list[str]]
    pieces: list[RowPiece]  # all rows that every model may read, in their order

    @classmethod
    def load(cls, folder: Path) -> DatasetRows:
        """Read the manifest of a data set; BadInput if it is missing or damaged."""
        if (folder / "croissant.json").exists():  # published
            published = Published.load(folder)
            pieces = [
                RowPiece(folder / entry.file, fabric, entry.split or "", rows, joined=True)
                for entry in published.files
                for fabric, rows in entry.rows.items()
            ]
            return cls(folder, dict(published.fabrics), dict(published.roles), pieces)
        manifest = Manifest.load(folder)
        # Extra rows of single models have other columns or no splits.
        shards = sorted((s for s in manifest.shards if s.kind == "components"), key=lambda shard: shard.start)
        pieces = [RowPiece(folder / s.file, s.fabric, s.split, s.rows, joined=False) for s in shards]
        return cls(folder, dict(manifest.fabrics), dict(manifest.roles), pieces)

    def of(self, split: str, fabrics: Sequence[str] | None = None) -> list[RowPiece]:
        """Return the pieces of a split, of some fabrics or all that have it; BadInput if there are no such rows."""
        if split not in get_args(Split):
            raise BadInput(str(self.folder), "split", split, nearest(split, get_args(Split)))
        by_fabric: dict[str, list[RowPiece]] = {}
        for piece in self.pieces:
            if piece.split == split:
                by_fabric.setdefault(piece.fabric, []).append(piece)
        chosen = [name for name in self.fabrics if name in by_fabric] if fabrics is None else fabrics
        for name in chosen:
            if name not in self.fabrics:
                raise BadInput(str(self.folder), "fabric", name, nearest(name, self.fabrics))
            if name not in by_fabric:
                raise BadInput(str(self.folder), "split", split, f"{name} has no such rows")
        if not chosen:
            raise BadInput(str(self.folder), "split", split, "no fabric has such rows")
        return [piece for name in chosen for piece in by_fabric[name]]
