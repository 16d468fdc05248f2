"""Fabrics: a draft, a warp yarn and a weft yarn, read from TOML.

A fabric file has a name, the source of its numbers, and the tables `[draft]`, `[warp]` and `[weft]`, and `[colours]` if
its ends or picks differ in colour; the presets beside this module are examples.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from functools import lru_cache
from itertools import cycle
from pathlib import Path
from typing import Annotated, Any

import tomli_w
from pydantic import Field, SerializerFunctionWrapHandler, Strict, model_serializer, model_validator

from weaves.colour_order import MOST_COLOURS, MOST_THREADS, ColourOrder, PaletteColour, ThreadColours, colours_of_yarns
from weaves.count import PerCm, with_widths
from weaves.draft import Draft, Loom, Matrix
from weaves.errors import BadInput, nearest
from weaves.families import Basket, Herringbone, Plain, Rib, Satin, Twill
from weaves.validation import FileName, Frozen, read_toml, validated
from weaves.variation import PATCH, SHADES, Variation
from weaves.yarn import Yarn

PRESETS = Path(__file__).parent / "presets"

Weave = Annotated[Plain | Rib | Basket | Twill | Herringbone | Satin | Matrix | Loom, Field(discriminator="family")]
"""The weave families; a file chooses one by `family`."""


Thickness = Annotated[float, Strict(), Field(ge=0.001, le=100)]


class Fabric(Frozen):
    """A woven fabric.

    Examples
    --------
    >>> denim = load_fabric("denim")
    >>> denim.weave.repeat
    (4, 4)
    >>> denim.model_copy(update={"name": "thin_denim", "optical_thickness": 0.5}).optical_thickness
    0.5
    """

    also_read = ("sett",)

    name: FileName
    source: str = Field(default="", max_length=2000)
    optical_thickness: Thickness = 2.0
    """Optical thickness T of the yarn layer."""
    yarns_per_cm: tuple[PerCm, PerCm] | None = None
    """Ends per centimetre and picks per centimetre: the physical size, where it is known; a file may call it `sett`."""
    draft: Weave  # the weave family and its numbers
    warp: Yarn  # the yarns along y
    weft: Yarn  # the yarns along x
    colours: ColourOrder | None = None  # colours of single ends and picks, in place of the colours of the two yarns
    variation: Variation | None = None  # differences of yarns, which pictures show

    @model_validator(mode="before")
    @classmethod
    def _from_counts(cls, table: Any) -> Any:
        return with_widths(table) if isinstance(table, Mapping) else table

    @model_validator(mode="after")
    def _keeps_energy(self) -> Fabric:
        thickness = self.optical_thickness
        for key, axis, yarn in (("warp", "ends", self.warp), ("weft", "picks", self.weft)):
            try:
                yarn.refuse_gain(thickness)
                if self.colours is not None:
                    key = "colours"
                    self.colours.refuse_gain(axis, yarn, thickness)
            except BadInput as error:
                raise BadInput(self.name, f"{key}.{error.key}", error.value, error.allowed) from error
        return self

    @model_serializer(mode="wrap")
    def _without_empty_fields(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out what is optional where there is none: files and hashes do not contain it."""
        optional = ("colours", "yarns_per_cm", "variation")
        return {key: value for key, value in dump(self).items() if key not in optional or value is not None}

    def thread_colours(self) -> tuple[ThreadColours, ThreadColours]:
        """Return the colours of the ends and of the picks, one row for each thread after which they repeat."""
        if self.colours is None:
            return colours_of_yarns([self.warp]), colours_of_yarns([self.weft])
        axes = (("ends", self.warp), ("picks", self.weft))
        ends, picks = (self.colours.thread_colours(axis, yarn, self.optical_thickness) for axis, yarn in axes)
        return ends, picks

    @property
    def weave(self) -> Draft:
        """The draft, woven."""
        return _woven(self.draft)

    def loom(self) -> Loom:
        """Return the loom that weaves it: that of the file if it states one, else `Draft.loom`."""
        return self.draft if isinstance(self.draft, Loom) else self.weave.loom()

    @property
    def repeat(self) -> tuple[int, int]:
        """Ends and picks after which weave and colours repeat: the extent of the cloth's own repeat in x and in y."""
        (ends, picks), (warp, weft) = self.weave.repeat, self.thread_colours()
        return math.lcm(ends, len(warp.diffuse)), math.lcm(picks, len(weft.diffuse))

    def average(self) -> Fabric:
        """Return the same cloth with the mean colours of its ends and picks on all of them."""
        if self.colours is None:
            return self
        warp, weft = (
            yarn.model_copy(update={name: tuple(values.mean(axis=0).tolist()) for name, values in found.items()})
            for yarn, found in zip((self.warp, self.weft), (c._asdict() for c in self.thread_colours()), strict=True)
        )
        return self.model_copy(update={"warp": warp, "weft": weft, "colours": None})

    def in_shades(self) -> Fabric:
        """Return the same cloth with the shades that `variation` gives its threads as their colours."""
        if self.variation is None or not self.variation.colour:
            return self
        own, palette, runs = self.colours.palette if self.colours else {}, {}, {}
        levels = min(SHADES, MOST_COLOURS // (2 * max(len(own), 1)))
        for axis, (key, yarn) in enumerate((("ends", self.warp), ("picks", self.weft))):
            names = (self.colours.threads(key) if self.colours else ()) or ("",)
            count = min(PATCH * math.lcm(self.weave.repeat[axis], len(names)), MOST_THREADS)
            shades = zip(cycle(names), self.variation.shades(axis, count, levels), strict=False)
            threads = [(name, shade, f"{name} {axis} {shade:.3f}") for name, shade in shades]
            runs[key] = [(shaded, 1) for _, _, shaded in threads]
            for name, shade, shaded in set(threads):
                dyed = own[name].on(yarn, self.optical_thickness) if name else yarn
                colours = {k: [shade * c for c in getattr(dyed, f"{k}_rgb")] for k in PaletteColour.model_fields}
                palette[shaded] = PaletteColour.model_validate(colours)
        return self.model_copy(update={"colours": ColourOrder(palette=palette, **runs)})

    def optics(self) -> dict[str, Any]:
        """Return all that the ground truth depends on, for fingerprints: no name, source, colour, size or variation."""
        return {
            "draft": self.weave.rows(),
            "warp": self.warp.optics(),
            "weft": self.weft.optics(),
            "optical_thickness": self.optical_thickness,
        }

    def back(self) -> Fabric:
        """Return the cloth whose front, seen from z > 0, is this one's back reflected in the fabric plane.

        Reflection keeps x and y, brings the other yarn on top, and turns a right-handed twist into a left-handed one.
        """
        return _turned(self)

    def to_toml(self) -> str:
        """Return a file that `load_fabric` reads back as an equal fabric."""
        text = tomli_w.dumps(self.model_dump(mode="json", exclude_none=True))
        # A list that ends with a number takes one line: colours, runs of threads.
        return re.sub(r"\[\n +([^\[\]]*[0-9]),\n *\]", lambda m: "[" + re.sub(r"\n +", " ", m[1]) + "]", text)


def preset_names() -> list[str]:
    """Return the names of the fabrics that come with the package."""
    return sorted(path.stem for path in PRESETS.glob("*.toml"))


def load_fabric(name_or_path: str | Path) -> Fabric:
    """Read a preset by its name, or a TOML file by its path, which ends in ``.toml``.

    BadInput if there is no such preset or file, or it does not describe a fabric.

    Examples
    --------
    >>> load_fabric("satin_8").weave.repeat
    (8, 8)
    """
    if isinstance(name_or_path, Path) or name_or_path.endswith(".toml"):
        path = Path(name_or_path)
        return validated(Fabric, read_toml(path), str(path))
    if name_or_path not in (known := preset_names()):
        allowed = f"a path ending in .toml or a preset is needed; {nearest(name_or_path, known)}"
        raise BadInput("fabric", "name", name_or_path, allowed)
    path = PRESETS / f"{name_or_path}.toml"
    return validated(Fabric, read_toml(path), f"preset {name_or_path}")


@lru_cache(maxsize=1024)
def _woven(family: Weave) -> Draft:
    return family.build()


@lru_cache(maxsize=64)
def _turned(fabric: Fabric) -> Fabric:
    draft = Matrix(rows=tuple(Draft(~fabric.weave.warp_over).rows()))
    warp, weft = (yarn.model_copy(update={"twist": -yarn.twist}) for yarn in (fabric.warp, fabric.weft))
    return fabric.model_copy(update={"draft": draft, "warp": warp, "weft": weft})
