"""Rows of a data set, generated here or published, in pieces: those of one fabric and split in one file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy.typing as npt

from pipeline.shards.joined import read_fabric
from pipeline.shards.manifest import Manifest, Published, Role
from pipeline.shards.store import read_columns
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric

SPLITS: Final = ("train", "validation", "test")

_OF_PUBLISHED: Final = "croissant.json"


class RowPiece(NamedTuple):
    """Rows of one fabric and split in one file."""

    path: Path
    fabric: str
    split: str
    rows: int
    joined: bool
    """True if the file may have rows of other fabrics too."""

    def read(self) -> dict[str, npt.NDArray[Any]]:
        """Return the rows by column, the fabric left out; BadInput if the file is missing or damaged."""
        if not self.joined:
            return read_columns(self.path, "components")
        found = read_fabric(self.path, self.fabric)
        if (rows := len(found["u"])) != self.rows:
            raise BadInput(str(self.path), "", f"has {rows:,} rows of {self.fabric}", f"{self.rows:,} are needed")
        return found


class DatasetRows(NamedTuple):
    """Fabrics and pieces of a data set in a folder."""

    folder: Path
    fabrics: dict[str, Fabric]
    roles: dict[Role, list[str]]
    """Names of the fabrics in each role."""
    pieces: list[RowPiece]
    """All rows that every model may read, in their order."""

    @classmethod
    def load(cls, folder: Path) -> DatasetRows:
        """Read the manifest of a data set; BadInput if it is missing or damaged."""
        if (folder / _OF_PUBLISHED).exists():
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
        """Return the pieces of a split, train, validation or test, of some fabrics or all that have it, one by one.

        BadInput if a split or fabric does not exist, or has no rows.
        """
        if split not in SPLITS:
            raise BadInput(str(self.folder), "split", split, nearest(split, SPLITS))
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
