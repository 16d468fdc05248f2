"""Content of a page: fabrics, methods, Records, pictures, and where they come from. Nothing heavy is imported here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.models.added.added_code import ADDED_MODEL
from pipeline.models.catalogue import CLASSES
from pipeline.models.options import Options
from reports.tables.number_format import display

if TYPE_CHECKING:
    from reports.options import BenchOptions, Role
    from reports.record import Machine, Record
    from weaves.fabric import Fabric


@dataclass(frozen=True)
class ModelNote:
    """A method in words."""

    name: str  # in the recipe; it distinguishes several models of one kind
    about: str  # kind and training in a few words
    fingerprint: str = ""  # of the trained model
    per_material: bool = False  # True if one model is trained for each fabric
    kind: str = ""  # kind of model, a key of `pipeline.models.catalogue.CLASSES` or `ADDED_MODEL`; empty: its name

    @property
    def learns(self) -> bool:
        """True if there is anything to train."""
        model = CLASSES.get(self.kind or self.name)
        return bool(self.fingerprint) if self.kind == ADDED_MODEL else model is None or model.learns

    @property
    def published(self) -> bool:
        """True if it is a published method, from which the package's may depart."""
        model = CLASSES.get(self.kind or self.name, Options)
        return model.departures is not Options.departures


@dataclass(frozen=True)
class PictureFile:
    """A picture that was rendered."""

    fabric: str  # empty for a scene, which has cloths of its own
    scene: str  # view of the fabric, or name of the scene
    method: str  # ``truth`` for the reference
    setting: str
    path: Path
    larger: bool = False  # True for a picture of a scene that is larger than the frames in which methods are measured

    @property
    def label(self) -> str:
        """Of the method with its setting."""
        return display(self.method, self.setting)

    @property
    def stem(self) -> str:
        """Of the names of its tiles."""
        return "-".join([self.fabric or "scene", self.scene, self.method, *self.setting.replace("=", "").split()])


@dataclass(frozen=True)
class PageInput:
    """Content of a page."""

    recipe: str
    about: str
    fingerprint: str  # of the recipe
    dataset: str  # name and fingerprint
    fabrics: Sequence[tuple[Fabric, Role]]
    models: Sequence[ModelNote]
    options: BenchOptions
    records: Sequence[Record]
    machine: Machine  # where the times were taken
    pictures: Sequence[PictureFile]
    live: Mapping[str, Path] = field(default_factory=dict)  # live pages of fabrics by name

    @property
    def shown(self) -> list[PictureFile]:
        """The pictures of fabrics, and those of scenes: the larger ones, where a scene has any."""
        larger = {picture.scene for picture in self.pictures if picture.larger}
        return [file for file in self.pictures if file.fabric or file.larger == (file.scene in larger)]

    @property
    def own(self) -> list[str]:
        """Names of the methods from outside the package, which the page leads with."""
        return [note.name for note in self.models if note.kind == ADDED_MODEL]
