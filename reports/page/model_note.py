"""A method of a page in words; nothing heavy is imported here."""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.models.added.added_method import ADDED
from pipeline.models.catalogue import CLASSES


@dataclass(frozen=True)
class ModelNote:
    """A method in words."""

    name: str
    """Name in the recipe; it distinguishes several models of one kind."""
    about: str
    """In a few words: kind and training."""
    fingerprint: str = ""
    """Of the trained model."""
    per_material: bool = False
    """True if one model is trained for each fabric."""
    kind: str = ""
    """Kind of model, a key of `pipeline.models.catalogue.CLASSES` or `ADDED`; empty: its name."""

    @property
    def learns(self) -> bool:
        """True if there is anything to train."""
        model = CLASSES.get(self.kind or self.name)
        return bool(self.fingerprint) if self.kind == ADDED else model is None or model.learns
