"""Content of a page: fabrics, methods, Records, pictures, and where they come from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.models.catalogue import CLASSES
from reports.options import BenchOptions
from reports.page.picture_strips import PictureFile
from reports.record import Machine, Record, Role
from weaves.fabric import Fabric


@dataclass(frozen=True)
class ModelNote:
    """A method in words."""

    name: str
    """As in the recipe: tells several models of one kind apart."""
    about: str
    """In a few words: kind and training."""
    fingerprint: str = ""
    """Of the trained model."""
    per_material: bool = False
    """Whether one model is trained for each fabric."""
    kind: str = ""
    """Kind of model, a key of `pipeline.models.catalogue.CLASSES`; empty: its name."""

    @property
    def learns(self) -> bool:
        """Whether there is anything to train."""
        model = CLASSES.get(self.kind or self.name)
        return model is None or model.learns


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
