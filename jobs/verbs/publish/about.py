"""Facts of a published data set that its card, its Croissant file and its citation share."""

from __future__ import annotations

from typing import NamedTuple

from jobs.verbs.publish.contents import PublishedPart
from pipeline.shards.manifest import Manifest


class About(NamedTuple):
    """Facts of a published data set.

    Attributes
    ----------
    manifest : Manifest
        Its fabrics, roles and options.
    parts : list of PublishedPart
        Its files of rows.
    licence : str
        SPDX identifier.
    authors : tuple of str
        Names.
    truth_version : int
        Version of the ground truth that answered the rows; 0 if the shards do not name it.
    """

    manifest: Manifest
    parts: list[PublishedPart]
    licence: str
    authors: tuple[str, ...]
    truth_version: int

    @property
    def title(self) -> str:
        """Title of the data set."""
        return f"Twillight {self.manifest.name}: ground truth of the appearance of woven cloth"

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
    def configs(self) -> dict[str, list[str]]:
        """Splits of each role that has rows."""
        found: dict[str, list[str]] = {}
        for part in self.parts:
            splits = found.setdefault(part.role, [])
            if part.split not in splits:
                splits.append(part.split)
        return found
