"""`maps.json`: the size of the cloth that a map shows, the numbers of the material, and the files."""

from __future__ import annotations

from importlib.metadata import version
from typing import Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from pipeline.materials.layout import Layout
from pipeline.materials.lobes import SHEEN_ROUGHNESS
from pipeline.materials.textures import Constants
from reports.images.texture import Kind
from weaves.fabric import Fabric

FILE: Final = "maps.json"

DEFAULT_YARNS_PER_CM: Final = (20.0, 20.0)
"""Ends and picks per centimetre of a fabric that does not state them."""

Pair = tuple[float, float]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)


class MapFiles(_Model):
    """One map."""

    meaning: str
    """Its content."""
    kind: Kind
    """colour, direction, share, height or number."""
    exr: str
    """Path in the folder."""
    png: str
    """Path in the folder."""


class Material(_Model):
    """Numbers that hold for all texels."""

    ior: float = Field(ge=1)
    """Index of refraction that goes with the map `specular_color`."""
    sheen_color: tuple[float, float, float]
    """Linear Rec. 709."""
    sheen_roughness: float
    """Roughness of the sheen."""
    transmitted: float = Field(ge=0, le=1)
    """Largest share of the light scattered many times that leaves on the other side."""


class AboutMaps(_Model):
    """Content of `maps.json`."""

    fabric: str
    """Name of the fabric."""
    generator: str
    """Program and version."""
    yarns: tuple[int, int]
    """Ends and picks that a map shows."""
    texels: tuple[int, int]
    """Width and height of the largest level."""
    yarns_per_cm: Pair
    """Ends and picks per centimetre."""
    yarns_per_cm_source: Literal["fabric", "default"]
    """`default`: the fabric does not state them."""
    size_cm: Pair
    """Width and height of the cloth that a map shows."""
    spacing_cm: float
    """Length of a yarn spacing: the geometric mean of both directions. Heights are in it."""
    height_span: Pair
    """Heights of the codes 0 and 65535 of height.png, in yarn spacings."""
    orientation: Literal["U along the picks, V along the ends; the lower left corner is the first end and pick"] = (
        "U along the picks, V along the ends; the lower left corner is the first end and pick"
    )
    """Axes of the pictures."""
    material: Material
    """Numbers that hold for all texels."""
    maps: dict[str, MapFiles]
    """Maps by name."""
    mip_levels: list[tuple[int, int]]
    """Width and height of the smaller levels: `mips/WIDTHxHEIGHT/NAME.exr` and `.png`."""
    files: dict[str, str] = {}
    """SHA-256 of every file, by path; that of `maps.json` is of its other keys."""


def yarns_per_cm(fabric: Fabric) -> Pair:
    """Return ends and picks per centimetre of a fabric, `DEFAULT_YARNS_PER_CM` if it does not state them."""
    return fabric.yarns_per_cm or DEFAULT_YARNS_PER_CM


def spacing_cm(fabric: Fabric) -> float:
    """Return the geometric mean of the yarn spacings."""
    ends, picks = yarns_per_cm(fabric)
    return float((ends * picks) ** -0.5)


def about(
    fabric: Fabric,
    found: Layout,
    material: Constants,
    span: Pair,
    maps: dict[str, tuple[Kind, str]],
    levels: list[tuple[int, int]],
) -> AboutMaps:
    """Return the content of `maps.json`."""
    ends, picks = yarns_per_cm(fabric)
    red, green, blue = (round(float(value), 6) for value in material.sheen)
    return AboutMaps(
        fabric=fabric.name,
        generator=f"twillight {version('twillight')}",
        yarns=(found.ends, found.picks),
        texels=(found.width, found.height),
        yarns_per_cm=(ends, picks),
        yarns_per_cm_source="fabric" if fabric.yarns_per_cm else "default",
        size_cm=(found.ends / ends, found.picks / picks),
        spacing_cm=spacing_cm(fabric),
        height_span=span,
        material=Material(
            ior=material.ior,
            sheen_color=(red, green, blue),
            sheen_roughness=SHEEN_ROUGHNESS,
            transmitted=material.transmitted,
        ),
        maps={
            name: MapFiles(meaning=meaning, kind=kind, exr=f"{name}.exr", png=f"{name}.png")
            for name, (kind, meaning) in maps.items()
        },
        mip_levels=levels,
    )
