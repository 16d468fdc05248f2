"""Files of a published data set: which shards are joined in which file; and the facts that several files share.

A file holds whole fabrics of one role and one split. Research repositories take about a hundred files, so fabrics share
a file if there are many.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from jobs.verbs.publish.citation import Citation
from pipeline.shards.manifest import Manifest, Role, ShardEntry

MOST_FILES: Final = 90
"""Most Parquet files, if each role and split has one at least."""

ROLES: Final[tuple[Role, ...]] = ("seen", "population", "unseen", "unseen_population")
POPULATIONS: Final[tuple[Role, ...]] = ("population", "unseen_population")
"""Roles of random fabrics."""
_SPLITS: Final = ("train", "validation", "test")


class PublishedPart(NamedTuple):
    """A file of rows of one role and one split."""

    file: str
    """Path within the folder."""
    role: Role
    split: str
    fabrics: tuple[str, ...]
    """Names of its fabrics, in the order of their rows."""
    shards: tuple[ShardEntry, ...]
    """Its shards, in the order of their rows."""

    @property
    def rows(self) -> int:
        """Number of rows."""
        return sum(shard.rows for shard in self.shards)

    def entry(self) -> dict[str, Any]:
        """Return what the manifest says of it: role, split, and the rows of each fabric."""
        rows = {name: sum(shard.rows for shard in self.shards if shard.fabric == name) for name in self.fabrics}
        return {"role": self.role, "split": self.split, "rows": rows}


def own_shards(manifest: Manifest) -> list[ShardEntry]:
    """Return the shards that every model may read; extra rows of single models are no part of the data set."""
    return [shard for shard in manifest.shards if shard.kind == "components"]


def parts_of(manifest: Manifest) -> list[PublishedPart]:
    """Return the files of a data set, by role, split and fabric."""
    shards: dict[tuple[str, str], list[ShardEntry]] = {}
    for shard in sorted(own_shards(manifest), key=lambda shard: shard.start):
        shards.setdefault((shard.fabric, shard.split), []).append(shard)
    parts = []
    for role in ROLES:
        for split in _SPLITS:
            names = [name for name in manifest.names(role) if (name, split) in shards]
            files = min(len(names), max(1, MOST_FILES * len(names) // len(shards)))
            for number in range(files):
                group = names[len(names) * number // files : len(names) * (number + 1) // files]
                rows = tuple(shard for name in group for shard in shards[name, split])
                file = f"{stem(role, split)}-{number:02}.parquet"
                parts.append(PublishedPart(file, role, split, tuple(group), rows))
    return parts


def stem(role: str, split: str) -> str:
    """Return the path of a role's and split's files, without their numbers; it says what they must not be used for.

    Rows of unseen cloth that are not for tests are for models of that cloth alone.
    """
    split = "test_only" if split == "test" else f"one_cloth_{split}" if role.startswith("unseen") else split
    return f"data/{role}/{split}"


class About(NamedTuple):
    """Facts of a published data set."""

    manifest: Manifest
    """Its fabrics, roles and options."""
    parts: list[PublishedPart]
    """Its files of rows."""
    licence: str
    """SPDX identifier."""
    citation: Citation
    """Reference to the data set."""
    truth_version: int
    """Version of the ground truth that answered the rows; 0 if the shards do not name it."""

    @property
    def id(self) -> str:
        """Name for programs."""
        return f"twillight-{self.manifest.name}"

    @property
    def summary(self) -> str:
        """Description of the data set in two sentences."""
        return (
            f"{self.rows:,} queries of the patch BSDF of {len(self.manifest.fabrics)} woven fabrics: a footprint, a "
            "direction to the light and one to the viewer, and the light that the cloth returns, computed from its "
            "weave and its yarns. Every answer has a standard error and a bound of its error."
        )

    @property
    def rows(self) -> int:
        """Number of rows."""
        return sum(part.rows for part in self.parts)

    @property
    def version(self) -> str:
        """Version: that of the columns, that of the ground truth, and 0."""
        return f"{self.manifest.schema_version}.{self.truth_version}.0"

    @property
    def sets(self) -> list[tuple[Role, str]]:
        """Roles and splits that have rows."""
        return list(dict.fromkeys((part.role, part.split) for part in self.parts))
