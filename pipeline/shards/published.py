"""Contents of a published data set: the manifest of the folder that `twillight publish` writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, FailFast, Field, ValidationError

from pipeline.shards.manifest import FILE, Role, Split
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.reading import MIB, read_json

_MOST_BYTES: Final = 64 * MIB
_MOST_FABRICS: Final = 110_000  # a population has at most 100,000


class PublishedFile(BaseModel):
    """One file of a published data set."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    file: Annotated[str, Field(pattern=r"^([A-Za-z0-9_-]{1,80}/){0,3}[A-Za-z0-9_.-]{1,80}$")]
    """Path within the folder."""
    bytes: int
    """Size."""
    sha256: str
    """Hash of its bytes."""
    role: Role | None = None
    """Role of its fabrics; None for files without rows."""
    split: Split | None = None
    """Split of its rows."""
    rows: dict[str, int] = {}
    """Number of rows of each of its fabrics."""


class Published(BaseModel):
    """The contents of a published data set."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    name: str
    """Name of its recipe."""
    version: str
    """Version of the columns, that of the truth, and 0."""
    fingerprint: str
    """Fingerprint of everything that shaped its rows."""
    schema_version: int
    """Version of the columns."""
    truth_version: int
    """Version of the ground truth; 0 if it is not known."""
    licence: str
    """SPDX identifier."""
    rows: int
    """Number of all rows."""
    roles: dict[Role, list[str]]
    """Names of the fabrics in each role."""
    fabrics: dict[str, Fabric]
    """Every fabric in full."""
    options: dict[str, Any]
    """The recipe's data set section."""
    files: Annotated[list[PublishedFile], FailFast()]
    """All files but this one."""

    @classmethod
    def load(cls, folder: Path) -> Published:
        """Read the manifest of a published data set; BadInput if it is missing, too large or not one."""
        path = folder / FILE
        try:
            wide = {"fabrics": _MOST_FABRICS, "rows": _MOST_FABRICS}
            return cls.model_validate(read_json(path, _MOST_BYTES, "a manifest", wide=wide))
        except FileNotFoundError as error:
            raise BadInput(str(path), "", "does not exist", "get the whole data set") from error
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            key = ".".join(map(str, first["loc"]))
            found = f"not a manifest ({key} {first['msg']})"
            raise BadInput(str(path), "", found, "get the data set again") from error

    def encoded(self) -> bytes:
        """Return the bytes of its file; the same contents give the same bytes."""
        content = self.model_dump(mode="json", exclude_none=True)
        return json.dumps(content, indent=1, ensure_ascii=False).encode() + b"\n"
