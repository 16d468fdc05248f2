"""Contents of a data set: its fabrics and their roles, its shards and their hashes.

Roles: `seen` fabrics are named by the recipe; `population` members are drawn at random and only trained on; `unseen`
fabrics are named and never shown to a general model (a per-material model, which knows no other fabric, reads their
training rows); `unseen_population` members are drawn at random and only measured.

`Published` is the manifest of the folder that `twillight publish` writes.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, FailFast, Field, ValidationError

from pipeline.atomic import atomic_write
from pipeline.shards.queries import Kind
from pipeline.shards.schema import SCHEMA_VERSION
from pipeline.shards.store import numbers_of, read_table, rows_of
from pipeline.truth.query import Answers, Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.reading import MIB, read_json
from weaves.validation import Frozen

Role = Literal["seen", "population", "unseen", "unseen_population"]
Split = Literal["train", "validation", "test"]
Contents = TypeVar("Contents", bound=BaseModel)

FILE = "manifest.json"

_MOST_BYTES: Final = 64 * MIB
_LINES: Final = json.JSONEncoder(sort_keys=True, separators=(",\n   ", ": "))
_MOST_FABRICS: Final = 110_000  # a population has at most 100,000


class ShardEntry(Frozen):
    """One shard of a data set."""

    file: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,80}\.parquet$")]
    """Name within the data set's folder."""
    fabric: str
    """Name of the fabric of all its rows."""
    kind: Kind = "components"
    """Kind of its rows, which names its columns (`pipeline.shards.schema`)."""
    split: str
    """Split of its rows: train, validation or test; for extra rows the name of their set."""
    start: int
    """First row of the split's stream."""
    rows: int
    sha256: str


class Manifest(Frozen):
    """The contents of a data set folder."""

    name: str
    """Name of its recipe."""
    fingerprint: str
    """Fingerprint of everything that shaped its own rows; extra rows are part of the models that learn from them."""
    schema_version: int = SCHEMA_VERSION
    """Version of the columns."""
    roles: dict[Role, Annotated[list[str], FailFast()]]
    """Names of the fabrics in each role."""
    fabrics: dict[str, Fabric]
    """Every fabric in full."""
    about: dict[str, Any]
    """The recipe's data set section."""
    shards: Annotated[list[ShardEntry], FailFast()]
    """The finished shards, in the order of fabric, split or set, and row."""

    @classmethod
    def load(cls, folder: Path) -> Manifest:
        """Read a data set's manifest; BadInput if it is missing, too large or not one."""
        return _read(cls, folder, ("fabrics",), ("generate the data set first", "generate the data set"))

    def save(self, folder: Path) -> None:
        """Write the manifest whole or not at all."""
        atomic_write(folder / FILE, self.encoded())

    def encoded(self) -> bytes:
        """Return the bytes of its file, JSON with sorted keys; the same contents give the same bytes."""
        rest = json.dumps(self.model_dump(mode="json", exclude={"shards"}), indent=1, sort_keys=True)
        # One shard at a time, which has no nested values: with an indent, json would keep 1.5 kilobytes for each.
        ordered = sorted(self.shards, key=lambda shard: (shard.fabric, shard.split, shard.start))
        shards = ",\n".join(f"  {{\n   {_LINES.encode(shard.model_dump())[1:-1]}\n  }}" for shard in ordered)
        text = rest.removesuffix("\n}") + ',\n "shards": [' + (f"\n{shards}\n ]" if shards else "]") + "\n}\n"
        return text.encode()

    def without(self, files: Collection[str]) -> Manifest:
        """Return the manifest without the shards in some files."""
        return self.model_copy(update={"shards": [shard for shard in self.shards if shard.file not in files]})

    def names(self, *roles: Role) -> list[str]:
        """Return the fabrics in any of the roles, in the recipe's order."""
        return [name for role in roles for name in self.roles.get(role, [])]

    def read(self, folder: Path, fabric: str, split: Split) -> tuple[Queries, Answers]:
        """Return all rows of a fabric's split in stream order, checksums verified; BadInput if there are none."""
        return rows_of(self.columns(folder, fabric, split))

    def by_fabric(self, folder: Path, fabrics: Sequence[str], split: str) -> dict[str, list[ShardEntry]]:
        """Return the shards of fabrics of a split or set, in stream order; BadInput if a fabric has none."""
        entries: dict[str, list[ShardEntry]] = {name: [] for name in fabrics}
        for shard in self.shards:
            if shard.split == split and shard.fabric in entries:
                entries[shard.fabric].append(shard)
        for fabric, own in entries.items():
            if not own:
                raise BadInput(str(folder / FILE), f"shards[{fabric}, {split}]", None, "no rows; generate them first")
            own.sort(key=lambda shard: shard.start)
        return entries

    def columns(self, folder: Path, fabric: str, split: str) -> dict[str, npt.NDArray[Any]]:
        """Return all rows of a fabric's split or set by column, the fabric left out; errors as `read`."""
        entries = self.by_fabric(folder, [fabric], split)[fabric]
        parts = [numbers_of(read_table(folder / entry.file, entry.kind)) for entry in entries]
        return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


class PublishedFile(Frozen):
    """One file of a published data set."""

    file: Annotated[str, Field(pattern=r"^([A-Za-z0-9_-]{1,80}/){0,3}[A-Za-z0-9_.-]{1,80}$")]
    """Path within the folder."""
    bytes: int
    sha256: str
    role: Role | None = None
    """Role of its fabrics; None for files without rows."""
    split: Split | None = None
    rows: dict[str, int] = Field(default_factory=dict)
    """Number of rows of each of its fabrics."""


class Published(Frozen):
    """The contents of a published data set; what `Manifest` has too means the same."""

    name: str
    version: str
    """Version of the columns, that of the truth, and 0."""
    fingerprint: str
    schema_version: int
    truth_version: int
    """Version of the ground truth; 0 if it is not known."""
    licence: str
    """SPDX identifier."""
    rows: int
    roles: dict[Role, list[str]]
    fabrics: dict[str, Fabric]
    options: dict[str, Any]
    """The recipe's data set section."""
    files: Annotated[list[PublishedFile], FailFast()]
    """All files but this one."""

    @classmethod
    def load(cls, folder: Path) -> Published:
        """Read the manifest of a published data set; BadInput if it is missing, too large or not one."""
        return _read(cls, folder, ("fabrics", "rows"), ("get the whole data set", "get the data set again"))

    def encoded(self) -> bytes:
        """Return the bytes of its file; the same contents give the same bytes."""
        content = self.model_dump(mode="json", exclude_none=True)
        return json.dumps(content, indent=1, ensure_ascii=False).encode() + b"\n"


def _read(contents: type[Contents], folder: Path, wide: Sequence[str], remedies: tuple[str, str]) -> Contents:
    """Read a manifest whose tables `wide` have an entry a fabric; `remedies` are for a missing and for a broken one."""
    path = folder / FILE
    try:
        found = read_json(path, _MOST_BYTES, "a manifest", wide=dict.fromkeys(wide, _MOST_FABRICS))
        return contents.model_validate(found)
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", remedies[0]) from error
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        key = ".".join(map(str, first["loc"]))
        raise BadInput(str(path), "", f"not a manifest ({key} {first['msg']})", remedies[1]) from error
