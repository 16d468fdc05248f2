"""Fit SAFETY, the factor between the estimated and the reported error of the estimator `quadrature`.

Command: ``python tests/fits/fit_quadrature_safety.py [--rows 100]``

The fitted value is the 95th percentile of the norm of the true error over the norm of the estimated one, for queries of
three fabrics (seed 18) at 2 % and .3 %. The reference has rules of 32 and 64 nodes an axis on every part.

Seen, with ``--rows 20``: fitted .97, in use 1.5, which covers 96.7 % of 120 answers.
"""

from __future__ import annotations

import argparse

import numpy as np

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.cloth import cloth_side, columns_of
from pipeline.truth.geometry.pieces import first_cells
from pipeline.truth.options import Limits, TruthOptions
from pipeline.truth.quadrature.adaptive import SAFETY, integrate_rows, quadrature_rows
from weaves.fabric import load_fabric

CUT = 2  # level from which on lines are cut, as in `quadrature_rows`


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rows", type=int, default=100)
    rows = parser.parse_args().rows
    ratios = []
    for name in ("polyester_lining", "satin_8", "gauze"):
        fabric = load_fabric(name)
        columns = columns_of(draw_queries(QueryOptions(max_angle=80.0), fabric.weave.repeat, 18, 0, rows))
        cloth = cloth_side(fabric, TruthOptions())
        limits = Limits(1e-12, 0.0, 32, 1 << 30)
        exact = integrate_rows(cloth, columns, first_cells(cloth.front), limits, CUT, 4, 5)[0]
        for tolerance in (0.02, 0.003):
            options = TruthOptions(relative_error=tolerance, absolute_error=0.0, max_count=1 << 14)
            mean, error, _, _ = quadrature_rows(cloth, columns, np.arange(rows), options, 0)
            wrong, estimated = (np.linalg.norm(v[:, :4], axis=1) for v in (mean - exact, error / SAFETY))
            ratios.append(wrong / np.maximum(estimated, 1e-12))
    ratio = np.concatenate(ratios)
    print(f"SAFETY: fitted {np.quantile(ratio, 0.95):.2f}, in use {SAFETY}; {ratio.size} answers")
    print(f"covered with the value in use: {np.mean(ratio <= SAFETY):.1%}")


if __name__ == "__main__":
    main()
