"""Content of a page: fabrics, methods, Records, pictures, and where they come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from reports.options import BenchOptions, Role
from reports.page.model_note import ModelNote
from reports.page.picture_strips import PictureFile
from reports.record import Machine, Record
from weaves.fabric import Fabric


@dataclass(frozen=True)
class PageInput:
    """Content of a page."""

    recipe: str
    about: str
    fingerprint: str
    """Of the recipe."""
    dataset: str
    """Name and fingerprint of the data set."""
    fabrics: Sequence[tuple[Fabric, Role]]
    models: Sequence[ModelNote]
    options: BenchOptions
    records: Sequence[Record]
    machine: Machine
    """Where the times were taken."""
    pictures: Sequence[PictureFile]
    live: Mapping[str, Path] = field(default_factory=dict)
    """Live page of each fabric that has one, by the fabric's name."""
