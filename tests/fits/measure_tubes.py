"""Measure how well closed tubes explain the light that goes straight through the measured shade.

Command: ``python tests/fits/measure_tubes.py [--drafts "twill 2/2,basket"] [--tied] [--held-out] [--places 16384]``

In the truth a ray goes straight through if it crosses the fabric plane in a gap and neither face of the cloth hides
that point. Between closed tubes it can also pass above one yarn and below the next. A tube is an ellipse along a
centre line that is level over a float and changes side by half a period of a cosine. Nine numbers are fitted by
differential evolution: the gap beside a warp and a weft, over their spacing; the half heights of both tubes; the sum
of the amplitudes of the centre lines over that of the half heights (1: tubes touch at crossings); the warp's part of
it; the spacing of picks over that of ends; the parts of a spacing in which warp and weft change sides. With `--tied`
tubes touch and change sides within .8 of a spacing: six numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cyclopts
import numpy as np
import numpy.typing as npt
from scipy.optimize import differential_evolution
from scipy.stats import qmc

from pipeline.bsdf.files import read_bsdf
from pipeline.compiled.arrays import Float64, Mask
from pipeline.compiled.decorators import kernel
from pipeline.fitting.fit_bsdf import known_lights
from pipeline.fitting.fitted import DRAFTS, cloth
from pipeline.fitting.measured import MEASURED
from pipeline.fitting.straight import Straight, middles, straight_of

BAND = "visible"
STEP = 0.03  # of a ray, in spacings of ends
BOUNDS = [
    (0.01, 0.5), (0.01, 0.5), (0.02, 0.6), (0.02, 0.6), (0.5, 2.0), (0.02, 0.98), (0.4, 2.5), (0.3, 1.0), (0.3, 1.0),
]  # fmt: skip
TIED = {4: 1.0, 7: 0.8, 8: 0.8}
GENERATIONS, MEMBERS = 60, 6


class Tubes(NamedTuple):
    """Tubes of both yarns: half widths, half heights, amplitudes, parts of a spacing in which they change sides."""

    warp: tuple[float, float, float, float]
    weft: tuple[float, float, float, float]
    picks: float
    """Spacing of picks over that of ends."""

    @classmethod
    def of(cls, numbers: Float64) -> Tubes:
        """Return the tubes of nine fitted numbers."""
        gap, other, height, thick, excess, part, picks, turn, back = map(float, numbers)
        rise = (height + thick) * excess
        warp = (1.0 - gap) / 2.0, height, rise * part, turn
        return cls(warp, (picks * (1.0 - other) / 2.0, thick, rise * (1.0 - part), back), picks)


@kernel
def _level(side: float, following: float, t: float, part: float) -> float:
    """Return the height of a centre line, over its amplitude, at a share t of the way between two crossings."""
    turned = (t - 0.5) / part + 0.5
    if side == following or turned <= 0.0:
        return side
    return following if turned >= 1.0 else side * math.cos(math.pi * turned)


@kernel
def _inside(x: float, y: float, z: float, over: Float64, tubes: Tubes) -> bool:
    """Return whether a point lies within a tube; `over` is 1 where the warp is on top, else -1."""
    picks, ends = over.shape
    half, height, rise, part = tubes.warp
    end, v = math.floor(x + 0.5), y / tubes.picks
    if abs(x - end) < half:
        pick, column = math.floor(v), int(end) % ends
        side, following = over[int(pick) % picks, column], over[int(pick + 1) % picks, column]
        centre = rise * _level(side, following, v - pick, part)
        if (z - centre) ** 2 < height * height * (1.0 - ((x - end) / half) ** 2):
            return True
    half, height, rise, part = tubes.weft
    pick = math.floor(v + 0.5)
    across = (v - pick) * tubes.picks
    if abs(across) < half:
        end, row = math.floor(x), int(pick) % picks
        side, following = -over[row, int(end) % ends], -over[row, int(end + 1) % ends]
        centre = rise * _level(side, following, x - end, part)
        return (z - centre) ** 2 < height * height * (1.0 - (across / half) ** 2)
    return False


@kernel
def _pass(directions: Float64, places: Float64, over: Float64, tubes: Tubes, passed: Float64) -> None:
    """Count the rays that meet no tube, (Q,), of directions (Q, 3) through places (K, 3) of the plane."""
    picks, ends = over.shape
    top = max(tubes.warp[1] + tubes.warp[2], tubes.weft[1] + tubes.weft[2])
    for k in range(len(places)):
        x, y = places[k, 0] * ends, places[k, 1] * picks * tubes.picks
        if _inside(x, y, 0.0, over, tubes):
            continue
        mirrored = -1.0 if places[k, 2] < 0.5 else 1.0
        for q in range(len(directions)):
            tx, ty = directions[q, 0] / directions[q, 2], mirrored * directions[q, 1] / directions[q, 2]
            step = STEP / math.sqrt(1.0 + tx * tx + ty * ty)
            z = 0.5 * step
            while z < top and not (
                _inside(x + tx * z, y + ty * z, z, over, tubes) or _inside(x - tx * z, y - ty * z, -z, over, tubes)
            ):
                z += step
            passed[q] += z >= top


def _shares(directions: Float64, places: Float64, over: Float64, tubes: Tubes) -> Float64:
    """Return the shares of rays that meet no tube, (Q,)."""
    passed = np.zeros(len(directions))
    _pass(directions, places, over, tubes, passed)
    return passed / len(places)


def fitted(draft: str, measured: Straight, directions: Float64, places: Float64, tied: bool, seed: int) -> Float64:
    """Return the nine numbers of the tubes of a draft with the least error."""
    over, free = _over(draft), [k for k in range(len(BOUNDS)) if not (tied and k in TIED)]

    def whole(numbers: Float64) -> Float64:
        every = np.array([TIED.get(k, 0.0) for k in range(len(BOUNDS))])
        every[free] = numbers
        return every

    def error(numbers: Float64) -> float:
        return measured.error(_shares(directions, places, over, Tubes.of(whole(numbers))))

    bounds = [BOUNDS[k] for k in free]
    best = differential_evolution(error, bounds, maxiter=GENERATIONS, popsize=MEMBERS, tol=1e-4, rng=seed, polish=False)
    return whole(best.x)


def _over(draft: str) -> Float64:
    return np.where(cloth(draft, (0.9, 0.9), (20.0, 20.0), (1.0, 1.0)).weave.warp_over, 1.0, -1.0)


def _of(measured: Straight, kept: Mask) -> Straight:
    return Straight(*(column[kept] for column in measured))


def main(
    drafts: str = ",".join(DRAFTS), tied: bool = False, held_out: bool = False, places: int = 1 << 14, seed: int = 0
) -> None:
    """Print errors, RMS over the mean, in sample or of each ring predicted by the others."""
    shade = read_bsdf(MEASURED["shade_6216"])
    basis = shade.basis
    measured = straight_of(shade, BAND, known_lights(shade, BAND) & (basis.ring > 0))
    directions, ring = basis.directions(measured.patches, *middles(measured.patches)), basis.ring[measured.patches]
    through: npt.NDArray[np.float64] = qmc.Sobol(3, seed=1).random(places)
    for draft in drafts.split(","):
        left_out = np.unique(ring) if held_out else [-1]
        shares = np.empty(len(ring))
        for one in left_out:
            kept, asked = ring != one, (ring == one) if held_out else (ring >= 0)
            numbers = fitted(draft, _of(measured, kept), directions[kept], through, tied, seed)
            shares[asked] = _shares(directions[asked], through, _over(draft), Tubes.of(numbers))
            error = _of(measured, asked).error(shares[asked])
            print(f"{draft}: {error:.3f} of ring {one}; numbers", np.round(numbers, 3), flush=True)
        print(f"{draft}: error {measured.error(shares):.3f}", flush=True)


if __name__ == "__main__":
    cyclopts.run(main)
