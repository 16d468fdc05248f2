"""Options of a method from outside: where its code is, the hash of the code, and the method's own settings.

No recipe holds these fields. They are made from `--add` or from an installed package (`jobs.recipe.added`), so a recipe
alone never runs code. Where the code lies and how long a call may take are no part of an identity.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field, SerializationInfo, SerializerFunctionWrapHandler, model_serializer

from pipeline.fingerprint import IDENTITY
from pipeline.models.options import Name, Options

ADDED: Final = "added"
"""The value of `model` of all methods from outside."""

GROUP: Final = "twillight.methods"
"""Group of the entry points by which an installed package offers methods."""

Kind = Literal["behind", "stretch", "curvature"]
"""Kind of queries beyond flat cloth, round footprints and light from the front."""

Limit = Annotated[float, Field(gt=0, le=86_400)]
"""Seconds."""

_PLACES: Final = ("source", "folder", "limit")


class AddedMethod(Options):
    """A method from outside the package."""

    learns: ClassVar[bool] = False
    seconds: ClassVar[tuple[float, float]] = (0.0, 1e-5)

    model: Literal["added"] = "added"
    """Mark of a method from outside."""
    name: Name
    """Name in tables."""
    source: str = Field(max_length=4096)
    """``module:name``, or the absolute path of a file with ``:name``."""
    folder: str = ""
    """Folder in which the module is looked for after all installed ones; empty if it is installed."""
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    """Hash of the file, or of all files of the package."""
    distribution: str = ""
    """Name and version of the installed distribution; empty for a file or folder."""
    stated: str = Field(max_length=64)
    """Version that the method states."""
    own: dict[str, Any] = Field(default={})
    """Its own options: the keywords that it is made with."""
    setting: str = ""
    """Variant that the method states."""
    answers: tuple[Kind, ...] = ()
    """Kinds of queries that it answers beside the plain ones."""
    limit: Limit = 600.0
    """Longest time of one call of the method, and of making it."""

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of queries that it evaluates."""
        return frozenset(self.answers)

    @property
    def variant(self) -> str:
        """Setting of its only method."""
        return self.setting

    @property
    def class_name(self) -> str:
        """Name of its class in the source."""
        return self.source.rpartition(":")[2]

    @property
    def origin(self) -> str:
        """Distribution and version, or name of the file; then the hash of the code."""
        place = self.source.rpartition(":")[0]
        where = self.distribution or (PurePath(place).name if place.endswith(".py") else place)
        return f"{where}, version {self.stated}, SHA-256 {self.sha256}"

    @model_serializer(mode="wrap")
    def _without_places(self, dump: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        content: dict[str, Any] = dump(self)
        if info.context != IDENTITY:
            return content
        return {name: value for name, value in content.items() if name not in _PLACES} | {"class": self.class_name}
