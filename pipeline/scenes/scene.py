"""Scenes: a Mitsuba 3 scene, what its shapes wear, and the way of its camera.

A shape wears the cloth named by the id of its outermost BSDF: `fabric_denim` is the cloth `denim`, in XML
(`<bsdf type="diffuse" id="fabric_denim"/>`) as in a dictionary (`{"type": "diffuse", "id": "fabric_denim"}`); what that
BSDF says otherwise plays no part. Other shapes block light and are seen beside the cloth and through it.

u runs along the weft, v along the warp, and the front of the cloth is where the shading normal points; where u, v are
left-handed about it, v is counted backwards, so that no cloth is ever a mirror image.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import Field

from weaves.validation import FileName, Frozen

PREFIX: Final = "fabric_"  # beginning of the id of a BSDF that represents a cloth

Yarns = Annotated[float, Field(gt=0, le=1e7)]
Length = Annotated[float, Field(ge=-1e6, le=1e6)]


class Cloth(Frozen):
    """Cloth of the shapes with one BSDF id."""

    fabric: str = ""
    """A preset, or the path of a fabric's TOML; left out: the preset that the BSDF's id names."""
    yarns: tuple[Yarns, Yarns] = (100.0, 100.0)
    """Yarn spacings in one unit of u and of v."""
    turn: float = Field(default=0.0, ge=-360, le=360)
    """Angle from u to the weft, in degrees, as the front shows it."""


class Scene(Frozen):
    """A scene and its frames: the camera moves, everything else stays."""

    name: FileName
    source: Path | Callable[[Any], dict[str, Any]]
    """A Mitsuba XML file; or a function that is given the module mitsuba and returns a dictionary of parts."""
    cloths: dict[str, Cloth] = Field(default_factory=dict)
    """Cloth of each ``fabric_<key>``; a key that is not listed is a preset with the default yarns."""
    frames: int = Field(default=24, ge=1, le=100_000)
    """Length of the camera's way."""
    step: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    """How far the camera moves from frame to frame: right, up, and forward, in the world's lengths."""
