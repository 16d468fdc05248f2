"""Random fabrics: many drafts and yarns to train a general network on, or to measure it on.

Fabric i of a population is a function of the seed and i alone, so a larger population begins with the smaller one. The
families `compound_twill`, `large_satin` and `irregular` share no draft with the others: a population of them is unseen
by a network that was trained on the others.

An irregular draft is a random matrix of 4 to 8 ends and picks. It is drawn again until the cloth hangs together, no
float is longer than `LONGEST_FLOAT`, and no other family has the draft.

The default ranges of roughness and relief are those of a published generator, quoted as stand-ins for the unknown
ones of [Chen2024Woven]; bend is chosen here. Roughness is drawn as the square of a uniform number.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from functools import cache
from typing import Literal, get_args

import numpy as np
from pydantic import Field, StrictBool, StrictInt, ValidationError, ValidationInfo, field_validator, model_validator

from weaves.draft import Draft, Family, Matrix, cells
from weaves.errors import BadInput
from weaves.fabric import Fabric, Thickness
from weaves.families import Basket, Herringbone, Plain, Rib, Satin, Twill, valid_moves
from weaves.validation import Frozen
from weaves.yarn import Number, Yarn

_Usual = Literal["plain", "rib", "basket", "twill", "broken_twill", "herringbone", "satin", "sateen"]
FamilyName = Literal[_Usual, "compound_twill", "large_satin", "irregular"]
LONGEST_TWILL = 8
SATIN_ENDS = (5, 7, 8)
LARGE_SATIN_ENDS = (9, 10)
IRREGULAR_REPEATS = (4, 8)  # fewest and most ends, and picks, of an irregular draft
LONGEST_FLOAT = 4  # longest float of an irregular draft, in cells

Range = tuple[Number, Number]


class Ranges(Frozen):
    """Ranges [lowest, highest] of the parameters of the yarns, drawn for each yarn separately."""

    roughness_warp: Range = (0.01, 0.49)  # roughness of the warp, uniform in its square root, as that of the weft
    roughness_weft: Range = (0.01, 0.49)
    relief: Range = (0.2, 2.0)  # scale of the height field
    width: Range = (1.0, 1.0)
    """Gap scale; the published generator takes [0.6, 0.9] for plain weaves, [0.85, 0.95] for the others."""
    bend: Range = (10.0, 50.0)  # largest inclination, degrees
    twist: Range = (0.0, 0.0)  # fibre angle, degrees; one value for both yarns, which a mill spins alike
    blend: Range = (0.5, 0.5)  # one value for both yarns, too
    optical_thickness: tuple[Thickness, Thickness] = (2.0, 2.0)  # uniform in its logarithm

    @field_validator("*")
    @classmethod
    def _allowed_in_a_yarn(cls, bounds: Range, info: ValidationInfo) -> Range:
        if bounds[0] > bounds[1]:
            raise ValueError("a range is [lowest, highest]")
        for value in bounds:
            if info.field_name == "optical_thickness":
                break  # its type says what a cloth may have
            try:
                Yarn.model_validate({"bend": 0.0, "roughness": 1.0, str(info.field_name).partition("_")[0]: value})
            except ValidationError as error:
                raise ValueError(error.errors()[0]["msg"]) from error
        return bounds


class Population(Frozen):
    """A set of random fabrics."""

    count: StrictInt = Field(default=0, ge=0, le=100_000)
    seed: StrictInt = Field(default=0, ge=0, lt=2**63)
    families: tuple[FamilyName, ...] = Field(default=get_args(_Usual), min_length=1)
    """Weave families, equally likely; write one twice to double its share."""
    solid: float = Field(default=0.0, ge=0, le=1)
    """Share of the fabrics whose yarns are as wide as their spacing, in place of the drawn width."""
    balanced: StrictBool = False
    """True: the families take turns, and of each the share `solid` is solid. False: both are drawn."""
    exclude: tuple[str, ...] = ()
    """Drafts, such as ``twill 4/4``, that must not occur, nor shifts, mirror images or rearrangements of them."""
    plain: Ranges = Ranges()  # ranges of plain, rib and basket weaves
    twill: Ranges = Ranges(roughness_warp=(0.49, 1), roughness_weft=(0.49, 1), relief=(1, 2), twist=(-30, -30))
    """Ranges of all twills."""
    satin: Ranges = Ranges(roughness_warp=(0.04, 0.49), roughness_weft=(0.49, 1.0), relief=(0.2, 1.0))
    """Ranges of satins and sateens."""
    irregular: Ranges = Ranges()

    @model_validator(mode="after")
    def _drafts_left(self) -> Population:
        known = [weave.build().name for weaves in _catalogue().values() for weave in weaves]
        for name in self.exclude:
            if name not in known:
                near = get_close_matches(name, known, n=3) or ["plain", "twill 4/4", "satin 8/3"]
                raise BadInput("population", "exclude", name, f"drafts of a population are called {', '.join(near)} …")
        if not _allowed(self.families, self.exclude):
            raise BadInput("population", "exclude", list(self.exclude), "at least one draft must remain")
        return self


def population_fabrics(population: Population, names: str = "random_{index:03d}") -> list[Fabric]:
    """Draw the fabrics of a population; `names` is the format of their names, of `index` and `family`."""
    allowed = _allowed(population.families, population.exclude)
    return [_draw(population, allowed, index, names) for index in range(population.count)]


def _draw(population: Population, allowed: list[tuple[FamilyName, list[Draft]]], index: int, names: str) -> Fabric:
    """Draw fabric `index`, using up random numbers in a fixed order."""
    random = np.random.default_rng([population.seed, index]).random
    drawn = int(random() * len(allowed))
    turn, own = divmod(index, len(allowed))
    family, drafts = allowed[own if population.balanced else drawn]
    share = random()
    draft = drafts[int(share * len(drafts))] if drafts else _irregular(population, index)
    ends, picks = draft.repeat
    shift = int(random() * ends), int(random() * picks)
    ranges = _ranges(population, family)
    if population.balanced:
        # Of the first n fabrics of a family, n * solid are solid, rounded down.
        solid = math.floor((turn + 1) * population.solid) > math.floor(turn * population.solid)
    else:
        # A stream of its own, so that the other numbers are what they were without it.
        solid = bool(np.random.default_rng([population.seed, index, 1]).random() < population.solid)

    def between(bounds: Range, share: Callable[[], float] = random) -> float:
        # Six decimals: a number that a person can copy from a manifest.
        return round(bounds[0] + (bounds[1] - bounds[0]) * share(), 6)

    def spin(roughness: Range, twist: float) -> Yarn:
        low, high = np.sqrt(roughness).tolist()
        alpha = min(max(round(between((low, high)) ** 2, 6), roughness[0]), roughness[1])
        relief, width = between(ranges.relief), between(ranges.width)
        shape = {"width": 1.0 if solid else width, "bend": between(ranges.bend), "twist": twist, "blend": blend}
        return Yarn(roughness=alpha, relief=relief, diffuse=(grey, grey, grey), **shape)

    twist, later = between(ranges.twist), np.random.default_rng([population.seed, index, 3]).random
    blend, (thin, thick) = between(ranges.blend, later), ranges.optical_thickness
    thickness = min(max(round(thin * (thick / thin) ** later(), 6), thin), thick)
    # Of thin yarns no brighter grey is legal; rows have unit colours.
    grey = min(0.3, math.floor(1e4 * Yarn(bend=0.0, roughness=1.0).most_diffuse(thickness)[0]) / 1e4)
    return Fabric(
        name=names.format(index=index, family=family),
        source=f"Drawn from seed {population.seed}: {draft.name}, begun {shift[0]} ends and {shift[1]} picks further.",
        optical_thickness=thickness,
        draft=Matrix(rows=tuple(draft.rolled(*shift).rows())),
        warp=spin(ranges.roughness_warp, twist),
        weft=spin(ranges.roughness_weft, twist),
    )


def _ranges(population: Population, family: FamilyName) -> Ranges:
    if family in ("plain", "rib", "basket"):
        return population.plain
    if family == "irregular":
        return population.irregular
    return population.satin if family in ("satin", "sateen", "large_satin") else population.twill


def _irregular(population: Population, index: int) -> Draft:
    """Draw the irregular draft of fabric `index`, from a stream of its own."""
    random = np.random.default_rng([population.seed, index, 2])
    fewest, most = IRREGULAR_REPEATS
    while True:
        draft = Draft(random.random(random.integers(fewest, most + 1, 2)) < 0.5, "irregular")
        found = cells(draft)
        longest = max(found.top_length.max(), found.under_length.max())
        if longest <= LONGEST_FLOAT and draft.hangs_together() and draft.canonical() not in _known():
            return draft


@cache
def _catalogue() -> dict[FamilyName, list[Family]]:
    """List every weave that a population can hold, by family, without the irregular ones."""
    steps = [((n,), (total - n,)) for total in range(3, LONGEST_TWILL + 1) for n in range(1, total)]
    # The two pairs of steps in one order only: the other order is the same cloth, begun elsewhere.
    pairs = itertools.combinations(itertools.product(range(1, LONGEST_TWILL), repeat=2), 2)
    compound = [tuple(zip(*pair, strict=True)) for pair in pairs if sum(map(sum, pair)) <= LONGEST_TWILL]
    groups = (2, 3, 4)

    def twills(numbers: Iterable[tuple[tuple[int, ...], ...]]) -> list[Family]:
        return [Twill(over=over, under=under, direction=d) for d in ("right", "left") for over, under in numbers]

    def satins(family: Literal["satin", "sateen"], sizes: Iterable[int]) -> list[Family]:
        return [Satin(family=family, ends=ends, move=move) for ends in sizes for move in valid_moves(ends)]

    return {
        "plain": [Plain()],
        "rib": [*(Rib(ends=1, picks=n) for n in groups), *(Rib(ends=n, picks=1) for n in groups)],
        "basket": [Basket(ends=ends, picks=picks) for ends in groups for picks in groups],
        "twill": twills(steps),
        "satin": satins("satin", SATIN_ENDS),
        "sateen": satins("sateen", SATIN_ENDS),
        "broken_twill": [Twill(family="broken_twill", over=n, under=m) for n, m in steps if sum(n + m) >= 4],
        "herringbone": [Herringbone(over=n, under=m) for n, m in steps],
        "large_satin": satins("satin", LARGE_SATIN_ENDS) + satins("sateen", LARGE_SATIN_ENDS),
        "compound_twill": twills(compound),
    }


@cache
def _known() -> set[tuple[tuple[int, int], bytes]]:
    return {weave.build().canonical() for weaves in _catalogue().values() for weave in weaves}


def _is_one_of(weave: Family, banned: set[tuple[tuple[int, int], bytes]]) -> bool:
    """Return whether a weave, or the straight twill that it rearranges, is one of some canonical forms."""
    forms = {weave.build().canonical()}
    if isinstance(weave, Twill | Herringbone):
        forms.add(Twill(over=weave.over, under=weave.under).build().canonical())
    return not banned.isdisjoint(forms)


@cache
def _allowed(families: tuple[FamilyName, ...], exclude: tuple[str, ...]) -> list[tuple[FamilyName, list[Draft]]]:
    """List the drafts of each family that `exclude` leaves, without families that it empties; no irregular ones."""
    drafts = [weave.build() for weaves in _catalogue().values() for weave in weaves]
    banned = {draft.canonical() for draft in drafts if draft.name in exclude}
    left = {f: [w.build() for w in _catalogue().get(f, ()) if not (banned and _is_one_of(w, banned))] for f in families}
    return [(family, left[family]) for family in families if left[family] or family == "irregular"]
