"""Fit _HIGHLIGHT and SAFETY of the estimator `quadrature`.

Command: ``python tests/fits/fit_quadrature.py [--rows 100]``

_HIGHLIGHT is the rate at which rules resolve a highlight. A rule of n nodes an axis misses a share
exp(-rate n alpha / angle) of the specular part, where alpha is the roughness and angle the larger angle by which the
surface turns across the part: pi for a whole float. The rate is fitted to root mean squares over 40 pairs of directions
(seed 19), for three fabrics without shadows, alpha from .1 to .3 and n = 4, 8, 16, by least squares where the share
lies between 1e-8 and .3.

SAFETY is the factor between the estimated and the reported error: the 95th percentile of the norm of the true error
over the norm of the estimated one, for queries of three fabrics (seed 18) at 2 % and .3 %. The reference has rules of
32 and 64 nodes an axis on every part.
What was seen is in reports/LOG.md.
"""

import math

import cyclopts
import numpy as np

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import ClothSide, WideQueries, cloth_side, columns_of
from pipeline.truth.geometry.pieces import first_cells
from pipeline.truth.options import Limits, TruthOptions
from pipeline.truth.quadrature.adaptive import _HIGHLIGHT, SAFETY, integrate_rows, quadrature_rows
from weaves.fabric import load_fabric


def by_rules(cloth: ClothSide, columns: WideQueries, cut: int, level: int) -> np.ndarray:
    """Return the answers of rules of 2 << level nodes an axis; lines are cut at lost light from the level `cut` on."""
    limits = Limits(1e-15, 0.0, 32, 1 << 30)
    return integrate_rows(cloth, columns, first_cells(cloth.front), limits, cut, level - 1, level)[0]


def fit_highlight() -> None:
    x, y = [], []
    for name in ("polyester_lining", "cotton_twill", "silk_charmeuse"):
        for alpha in (0.1, 0.15, 0.2, 0.25, 0.3):
            fabric = load_fabric(name)
            yarns = {key: getattr(fabric, key).model_copy(update={"roughness": alpha}) for key in ("warp", "weft")}
            fabric = fabric.model_copy(update=yarns)
            queries = draw_queries(QueryOptions(sigma=(20.0, 40.0), max_angle=45.0), fabric.weave.repeat, 19, 0, 40)
            cloth, columns = cloth_side(fabric, TruthOptions(parallax=False, shadows=False)), columns_of(queries)
            # Kinks would hide the rate, so lines are cut from level 1 on.
            *rules, exact = (by_rules(cloth, columns, 1, level)[:, :2] for level in (1, 2, 3, 5))
            for level, specular in enumerate(rules, 1):
                missed = np.linalg.norm(specular - exact, axis=1) / np.linalg.norm(exact, axis=1)
                share = math.sqrt(np.mean(np.square(missed)))
                if 1e-8 < share < 0.3:
                    x.append((2 << level) * alpha / math.pi)
                    y.append(math.log(share))
    slope, offset = np.polyfit(x, y, 1)
    line = f"_HIGHLIGHT: fitted {-slope:.1f}, in use {_HIGHLIGHT}; factor: fitted {math.exp(offset):.2f}, in use 2"
    print(f"{line}; {len(x)} rules")


def fit_safety(rows: int) -> None:
    """Print the factor, from a number of queries of each fabric."""
    ratios = []
    for name in ("polyester_lining", "satin_8", "gauze"):
        fabric = load_fabric(name)
        columns = columns_of(draw_queries(QueryOptions(max_angle=80.0), fabric.weave.repeat, 18, 0, rows))
        cloth = cloth_side(fabric, TruthOptions(walls="left_out"))
        exact = by_rules(cloth, columns, 2, 5)
        for tolerance in (0.02, 0.003):
            options = TruthOptions(relative_error=tolerance, absolute_error=0.0, max_count=1 << 14)
            mean, error, _, _ = quadrature_rows(cloth, columns, np.arange(rows), options, 0)
            wrong, estimated = (np.linalg.norm(v[:, :4], axis=1) for v in (mean - exact, error / SAFETY))
            ratios.append(wrong / np.maximum(estimated, 1e-12))
    ratio = np.concatenate(ratios)
    print(f"SAFETY: fitted {np.quantile(ratio, 0.95):.2f}, in use {SAFETY}; {ratio.size} answers")
    print(f"covered with the value in use: {np.mean(ratio <= SAFETY):.1%}")


def main(rows: int = 100) -> None:
    """Print both constants as fitted and in use."""
    fit_highlight()
    fit_safety(rows)


if __name__ == "__main__":
    cyclopts.run(main)
