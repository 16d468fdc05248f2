"""Colour orders: the colours of single ends and picks, for stripes, checks and colour-and-weave effects.

A colour order is a palette and two sequences, that of the ends and that of the picks. Each sequence starts at the first
end (pick) of the draft and repeats on its own: its length need not fit the repeat of the weave.
"""

from typing import Annotated, Any, Final, NamedTuple, Self

import numpy as np
import numpy.typing as npt
from pydantic import Field, StrictInt, model_validator

from weaves.colour import Colour, linear_rgb
from weaves.draft import smallest_period
from weaves.errors import BadInput, nearest
from weaves.validation import Frozen
from weaves.yarn import Yarn

MOST_COLOURS: Final = 256  # most colours of a palette
MOST_THREADS: Final = 4096  # most ends, and most picks, after which the colours must repeat

Run = tuple[str, Annotated[StrictInt, Field(ge=1, le=MOST_THREADS)]]
"""A name of the palette, and the number of neighbouring threads that have this colour."""


class ThreadColours(NamedTuple):
    """Colours k_s, k_d and k_dt of the n threads after which a sequence repeats, linear sRGB, float64 (n, 3)."""

    specular: npt.NDArray[np.float64]
    diffuse: npt.NDArray[np.float64]
    diffuse_transmission: npt.NDArray[np.float64]


class PaletteColour(Frozen):
    """A colour of threads, as `Yarn` has it; what is not given is that of the yarn."""

    diffuse: Colour
    specular: Colour | None = None
    diffuse_transmission: Colour | None = None
    """If not given, as much of the yarn's as the other colours leave (`Yarn.most_diffuse`)."""

    def on(self, yarn: Yarn, thickness: float) -> Yarn:
        """Return a yarn in this colour, of a layer of an optical thickness."""
        specular = yarn.specular if self.specular is None else self.specular
        dyed = yarn.model_copy(update={"specular": specular, "diffuse": self.diffuse})
        through: Any = self.diffuse_transmission
        if through is None:
            limits = zip(yarn.diffuse_transmission_rgb, dyed.most_diffuse(thickness), dyed.diffuse_rgb, strict=True)
            through = tuple(max(min(k, most - back), 0.0) for k, most, back in limits)
        return dyed.model_copy(update={"diffuse_transmission": through})


class ColourOrder(Frozen):
    """The colours of single ends and picks.

    Examples
    --------
    >>> check = {"palette": {"white": {"diffuse": "#ffffff"}, "red": {"diffuse": "#aa1020"}}}
    >>> order = ColourOrder.model_validate(check | {"ends": [["white", 4], ["red", 4]]})
    >>> order.threads("ends")[3:5]
    ('white', 'red')
    >>> order.threads("picks")
    ()
    """

    palette: dict[Annotated[str, Field(min_length=1, max_length=60)], PaletteColour] = Field(
        min_length=1, max_length=MOST_COLOURS
    )
    """Colours by name."""
    ends: tuple[Run, ...] = Field(default=(), max_length=MOST_THREADS)
    """Runs of neighbouring ends, from the first end on; without any, all ends have the colours of the warp yarn."""
    picks: tuple[Run, ...] = Field(default=(), max_length=MOST_THREADS)
    """Runs of neighbouring picks, from the first pick on; without any, all picks have those of the weft yarn."""

    def __hash__(self) -> int:
        return hash((tuple(sorted(self.palette.items(), key=lambda item: item[0])), self.ends, self.picks))

    @model_validator(mode="after")
    def _names_its_colours(self) -> Self:
        for key, runs in (("ends", self.ends), ("picks", self.picks)):
            for name, _ in runs:
                if name not in self.palette:
                    raise ValueError(f"{key} name the colour {name!r}: {nearest(name, self.palette)}")
            if (count := sum(number for _, number in runs)) > MOST_THREADS:
                raise ValueError(f"{key} repeat after {count} threads: at most {MOST_THREADS} are allowed")
        return self

    def threads(self, axis: str) -> tuple[str, ...]:
        """Return the colour of each thread of the smallest repeat of the ``"ends"`` or ``"picks"``."""
        runs = self.ends if axis == "ends" else self.picks
        names = np.array([name for name, number in runs for _ in range(number)], dtype=object)
        return tuple(names[: smallest_period(names)])

    def refuse_gain(self, axis: str, yarn: Yarn, thickness: float) -> None:
        """Refuse colours in which the threads of a yarn would send out more light than they receive; BadInput."""
        for name in sorted(set(self.threads(axis))):
            try:
                self.palette[name].on(yarn, thickness).refuse_gain(thickness)
            except BadInput as error:
                key = f"palette.{name}.{error.key}"
                raise BadInput(error.where, key, error.value, f"on {axis} {error.allowed}") from error

    def thread_colours(self, axis: str, yarn: Yarn, thickness: float) -> ThreadColours:
        """Return the colours of the ``"ends"`` or ``"picks"``, which are of one yarn; a single row without an order."""
        names = self.threads(axis)
        dyed = {name: self.palette[name].on(yarn, thickness) for name in set(names)}
        return colours_of_yarns([dyed[name] for name in names] or [yarn])


def colours_of_yarns(yarns: list[Yarn]) -> ThreadColours:
    """Return the colours of some yarns, one row each."""
    columns = (np.array([linear_rgb(getattr(yarn, name)) for yarn in yarns]) for name in ThreadColours._fields)
    return ThreadColours(*columns)
