"""The patch BSDF of a cloth as a renderer uses it: `sample`, `pdf` and `eval` of one object.

Any method answers, with the fallback where it does not: footprints of any shape, viewer and light on either side.
Directions are drawn from lobes of the fabric (pipeline.analytic.importance), which know no method: their density is
exact whatever the method answers, and the weights make the estimate that of the method.

    L(wo) = integral over the sphere of f_P(wi, wo) L(wi) d(wi) + transparency L(-wo)

A sample's weight times L(wi) has this mean. Light straight through is a delta lobe: `sample` chooses it with a
probability of its own, and neither `eval` nor `pdf` knows it. On curved cloth all this is of view rays that do not
leave it again; the coverage is the caller's part (`pipeline.mitsuba.worn`).
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.analytic.importance import lobes as importance_lobes
from pipeline.analytic.importance.lobes import STRAIGHT, TZ, Lobes
from pipeline.analytic.importance.mixture import density_rows, draw_rows
from pipeline.compiled.arrays import Float32, Float64, Mask
from pipeline.models.fallback import Fallback
from pipeline.models.named import named_method
from pipeline.scenes.bounces import check_bounces
from pipeline.scenes.options import BOUNCES, Bounces
from pipeline.scenes.picture import TruthAnswers
from pipeline.scenes.shade import shade
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

USUAL_METHOD: Final = "soft_nodes:2"  # method that answers unless another one is given


class Sample(NamedTuple):
    """N drawn directions."""

    wi: Float32  # unit vectors to the light, over the whole sphere, (N, 3)
    pdf: Float32  # their density, 1/sr; the probability of the delta lobe where light goes straight through, (N,)
    straight: Mask  # where light goes straight through, wi = -wo, (N,)
    weight: Float64
    """Linear RGB: f_P / pdf, with the incident cosine inside; the transparency over its probability where straight,
    (N, 3)."""


class Drawn(NamedTuple):
    """N drawn directions without their weights; columns as in `Sample`."""

    wi: Float32
    pdf: Float32
    straight: Mask


class PatchBSDF:
    """A cloth's patch BSDF: values, and directions drawn with their density.

    `method` evaluates: a name as on the command line (`pipeline.models.named`), a fallback, or the truth. `points` of
    the footprint have a lobe each, at least 1; 1 has its exact lobe. `widening`, >= 0, is a factor on the widening of a
    lobe by the spread of the tangents. All `bounces` add the light that yarns give to each other
    (`pipeline.scenes.bounces`). BadInput if there is no such method, or a number is out of its range.

    Examples
    --------
    One direction for a pixel that sees some yarns of a silk:

    >>> from weaves.fabric import load_fabric
    >>> silk = PatchBSDF(load_fabric("silk_charmeuse"))
    >>> up = [[0.0, 0.0, 1.0]]
    >>> looks = Queries.round(u=[0.5], v=[0.5], sigma=[0.7], wi=up, wo=up)
    >>> sample = silk.sample(looks, np.array([[0.3, 0.2, 0.6]]))
    >>> values, pdf = silk.eval_pdf(looks._replace(wi=sample.wi))
    >>> bool(np.allclose(values / pdf[:, None], sample.weight))
    True
    """

    def __init__(
        self,
        fabric: Fabric,
        method: str | Fallback | TruthAnswers = USUAL_METHOD,
        points: int = 8,
        widening: float = 2.0,
        bounces: Bounces = BOUNCES,
    ) -> None:
        check_bounces(bounces, "PatchBSDF")
        if points < 1:
            raise BadInput("PatchBSDF", "points", points, "must be 1 or more")
        if not 0.0 <= widening < np.inf:
            raise BadInput("PatchBSDF", "widening", widening, "must be a number from 0 on")
        self.fabric, self.bounces = fabric, bounces
        self.method = named_method(method, "PatchBSDF", "method") if isinstance(method, str) else method
        self._widening = widening
        self._places = importance_lobes.point_places(points)
        self._front = importance_lobes.tabulate_surface(fabric)
        self._back: importance_lobes.LobeSurface | None = None

    def lobes(self, looks: Queries) -> Lobes:
        """Return the mixtures of N looks, whose wi does not matter, for several calls about them."""
        behind = looks.wo[:, 2] < 0.0
        if not behind.any():
            return importance_lobes.find_lobes(self._front, looks, self._places, self._widening)
        if self._back is None:
            self._back = importance_lobes.tabulate_surface(self.fabric.back())
        front = importance_lobes.find_lobes(self._front, looks.take(~behind), self._places, self._widening)
        back = importance_lobes.find_lobes(self._back, looks.turned().take(behind), self._places, self._widening)
        result = Lobes(*(np.empty((len(behind), *column.shape[1:]), np.float32) for column in front))
        for whole, own, other in zip(result, front, back, strict=True):
            whole[~behind], whole[behind] = own, other
        # Turned back: reflected in the fabric plane.
        result.flakes[behind, TZ] *= np.float32(-1.0)
        return result

    def sample(self, looks: Queries, random: npt.ArrayLike, lobes: Lobes | None = None, seed: int = 0) -> Sample:
        """Draw one direction for each of N looks, whose own wi does not matter.

        `random` (N, 3) are numbers in [0, 1), `lobes` what the function of that name returned for these looks, `seed`
        that of the method. BadInput if `random` has another shape, or numbers outside [0, 1).
        """
        wi, pdf, straight = self.draw(looks, random, lobes)
        queries = looks._replace(wi=wi)
        weight = np.empty((len(wi), 3))
        weight[~straight] = self.eval(queries.take(~straight), seed) / pdf[~straight, None]
        if straight.any():
            through = self.method.transparency(self.fabric, queries.take(straight), seed)
            weight[straight] = (through / pdf[straight])[:, None]
        return Sample(wi, pdf, straight, weight)

    def draw(self, looks: Queries, random: npt.ArrayLike, lobes: Lobes | None = None) -> Drawn:
        """Draw directions as `sample` does, without asking the method for their weights."""
        numbers = _numbers(random, len(looks.u))
        found, wo = self._known(looks, lobes), np.ascontiguousarray(looks.wo, np.float32)
        wi, pdf = np.empty((len(wo), 3), np.float32), np.empty(len(wo), np.float32)
        straight = np.empty(len(wo), np.bool_)
        draw_rows(found, wo, numbers, wi, pdf, straight)
        return Drawn(wi, pdf, straight)

    def pdf(self, queries: Queries, lobes: Lobes | None = None) -> Float32:
        """Return the density of each query's wi, (N,), 1/sr; its integral is 1 minus the probability `straight`."""
        found, result = self._known(queries, lobes), np.empty(len(queries.u), np.float32)
        wi, wo = (np.ascontiguousarray(column, np.float32) for column in (queries.wi, queries.wo))
        density_rows(found, wi, wo, result)
        return result

    def eval(self, queries: Queries, seed: int = 0) -> Float64:
        """Return f_P of each query in linear RGB, (N, 3), 1/sr, with the incident cosine inside."""
        components = self.method.predict(self.fabric, queries, seed)
        return shade(self.fabric, components, queries, self.bounces, self.method.colours(self.fabric, queries, seed))

    def eval_pdf(self, queries: Queries, lobes: Lobes | None = None, seed: int = 0) -> tuple[Float64, Float32]:
        """Return `eval` and `pdf` of each query."""
        return self.eval(queries, seed), self.pdf(queries, lobes)

    def straight(self, looks: Queries, lobes: Lobes | None = None) -> Float32:
        """Return the probability with which `sample` lets light go straight through, (N,)."""
        return self._known(looks, lobes).rest[:, STRAIGHT]

    def _known(self, looks: Queries, lobes: Lobes | None) -> Lobes:
        if lobes is None:
            return self.lobes(looks)
        if len(lobes.rest) != len(looks.u):
            allowed = f"must be those of the {len(looks.u)} looks"
            raise BadInput("PatchBSDF", "lobes", f"{len(lobes.rest)} rows", allowed)
        return lobes


def _numbers(random: npt.ArrayLike, rows: int) -> Float64:
    """Return random numbers as float64 (rows, 3); refuse others."""
    try:
        numbers = np.ascontiguousarray(random, np.float64)
    except (TypeError, ValueError):
        raise BadInput("sample", "random", random, f"must be numbers in [0, 1), of shape ({rows}, 3)") from None
    if numbers.shape != (rows, 3):
        raise BadInput("sample", "shape of random", numbers.shape, f"must be ({rows}, 3): three numbers a look")
    wrong = ~((numbers >= 0.0) & (numbers < 1.0))
    if wrong.any():
        row, column = (int(index) for index in np.argwhere(wrong)[0])
        raise BadInput("sample", f"random[{row}, {column}]", float(numbers[row, column]), "must be in [0, 1)")
    return numbers
