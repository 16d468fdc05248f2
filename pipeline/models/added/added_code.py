"""Options of a method or metric from outside: its code, with place, hash and version, and a method's own options.

No recipe holds these fields. They are made from `--add` or from an installed package (`jobs.recipe.added`), so a recipe
alone never runs code. Where the code lies and its limits are no part of an identity.
"""

from pathlib import PurePath
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field, SerializationInfo, SerializerFunctionWrapHandler, model_serializer

from pipeline.fingerprint import IDENTITY
from pipeline.models.options import Options
from weaves.validation import FileName, Frozen

ADDED_MODEL: Final = "added"  # the value of `model` of all methods from outside
GROUP: Final = "twillight.methods"  # group of the entry points by which an installed package offers methods

Kind = Literal["behind", "stretch", "curvature"]
"""Kind of queries beyond flat cloth, round footprints and light from the front."""


class CallLimits(Frozen):
    """Limits of code from outside; no part of an identity."""

    limit: Annotated[float, Field(gt=0, le=86_400)] = 600.0
    """Longest time of one call, in seconds."""
    memory: Annotated[float, Field(gt=0, le=1024)] = 4.0
    """Most memory of each of its processes, in GiB: of data that is its own, not of mapped files."""


_PLACES: Final = ("source", "folder", *CallLimits.model_fields)


class AddedCode(CallLimits):
    """A class or function from outside the package."""

    source: str = Field(max_length=4096)
    """``module:name``, or the absolute path of a file with ``:name``."""
    folder: str = ""
    """Folder in which the module is looked for after all installed ones; empty if it is installed."""
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    """Hash of the file, or of all files of the package."""
    distribution: str = ""
    """Name and version of the installed distribution; empty for a file or folder."""
    stated: str = Field(max_length=64)
    """Version that the code states."""

    @property
    def in_source(self) -> str:
        """Name of the class or function in the source."""
        return self.source.rpartition(":")[2]

    @property
    def origin(self) -> str:
        """Distribution and version, or name of the file; then the hash of the code."""
        place = self.source.rpartition(":")[0]
        where = self.distribution or (PurePath(place).name if place.endswith(".py") else place)
        return f"{where}, version {self.stated}, SHA-256 {self.sha256}"

    @model_serializer(mode="wrap")
    def _identified(self, dump: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        content: dict[str, Any] = dump(self)
        if info.context != IDENTITY:
            return content
        return {name: value for name, value in content.items() if name not in _PLACES} | {"in_source": self.in_source}


class AddedFunction(AddedCode):
    """A function from outside, which measures something."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")
    """Name of the metric."""
    title: str = Field(max_length=60)
    """Heading of its column on the page."""
    definition: str = Field(max_length=1000)
    """Explanation on the page."""
    unit: str = Field(max_length=20)
    """Unit of its values."""
    better: str
    """Direction of a better value."""
    format: str
    """How tables print a value."""


class AddedMethod(AddedCode, Options):
    """A method from outside the package."""

    seconds: ClassVar[tuple[float, float]] = (2e-5, 1e-5)

    model: Literal["added"] = "added"
    """Mark of a method from outside."""
    name: FileName
    """Name in tables."""
    own: dict[str, Any] = Field(default={})
    """Its own options: the keywords that it is made with."""
    setting: str = ""
    """Variant that the method states."""
    answers: tuple[Kind, ...] = ()
    """Kinds of queries that it answers beside the plain ones."""
    has_network: bool = False
    """True if it has a network, which the benchmark trains."""
    has_one_fabric: bool = False
    """True if a trained network knows a single fabric."""

    @property
    def learns(self) -> bool:  # type: ignore[override]
        """True if it is trained."""
        return self.has_network

    @property
    def of_one_material(self) -> bool:  # type: ignore[override]
        """True if a trained network knows a single fabric."""
        return self.has_one_fabric

    @property
    def kinds(self) -> frozenset[str]:  # type: ignore[override]
        """Kinds of queries that it evaluates."""
        return frozenset(self.answers)

    @property
    def variant(self) -> str:  # type: ignore[override]
        """Setting of its only method."""
        return self.setting
