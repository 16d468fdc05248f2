"""Fit _HIGHLIGHT, the rate at which the rules of the estimator `quadrature` resolve a highlight.

Command: ``python tests/fits/fit_quadrature_highlight.py``

A rule of n nodes an axis misses a share exp(-rate n alpha / angle) of the specular part, where alpha is the roughness
and angle the larger angle by which the surface turns across the part: pi for a whole float. The rate is fitted to root
mean squares over 40 pairs of directions (seed 19), for three fabrics without shadows, alpha from .1 to .3 and n = 4, 8,
16, by least squares where the share lies between 1e-8 and .3.

Seen: rate 6.8 and factor .22 over 43 rules, in use 14 and 2. At n alpha / angle = .25 that is a share of .04, in use
.06; at .5 it is .007, in use .002: for fine rules the value in use is too optimistic as a bound on its own. The
reported error also holds the last change of each part.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.geometry.pieces import first_cells
from pipeline.truth.options import Limits, TruthOptions
from pipeline.truth.quadrature.adaptive import _HIGHLIGHT, integrate_rows
from weaves.fabric import load_fabric

CUT = 1  # level from which on lines are cut where light or view is lost: kinks would hide the rate


def main() -> None:
    x, y = [], []
    for name in ("polyester_lining", "cotton_twill", "silk_charmeuse"):
        for alpha in (0.1, 0.15, 0.2, 0.25, 0.3):
            fabric = load_fabric(name)
            yarns = {key: getattr(fabric, key).model_copy(update={"roughness": alpha}) for key in ("warp", "weft")}
            fabric = fabric.model_copy(update=yarns)
            queries = draw_queries(QueryOptions(sigma=(20.0, 40.0), max_angle=45.0), fabric.weave.repeat, 19, 0, 40)
            cloth, columns = cloth_side(fabric, TruthOptions(shadows=False)), columns_of(queries)

            def specular(level: int, cloth=cloth, columns=columns) -> np.ndarray:
                limits = Limits(1e-15, 0.0, 32, 1 << 30)
                cells = first_cells(cloth.front)
                return integrate_rows(cloth, columns, cells, limits, CUT, level - 1, level)[0][:, :2]

            exact = specular(5)
            for level in (1, 2, 3):
                missed = np.linalg.norm(specular(level) - exact, axis=1) / np.linalg.norm(exact, axis=1)
                share = math.sqrt(np.mean(np.square(missed)))
                if 1e-8 < share < 0.3:
                    x.append((2 << level) * alpha / math.pi)
                    y.append(math.log(share))
    slope, offset = np.polyfit(x, y, 1)
    line = f"_HIGHLIGHT: fitted {-slope:.1f}, in use {_HIGHLIGHT}; factor: fitted {math.exp(offset):.2f}, in use 2"
    print(f"{line}; {len(x)} rules")


if __name__ == "__main__":
    main()
