"""Fit what `selvage` expects, pipeline/models/selvage/expected.json: errors against the truth, and seconds.

Command: ``python tests/fits/fit_selvage_errors.py [--presets voile,denim] [--random 12] [--rows 768] [--seed 31]``

Presets and random cloths (ranges of the recipe `standard`, of other seeds, and usual ones), lit from the front and from
behind, flat and curved. The squared error of an answer has the mean m plus the variance v of the truth's noise; log m
is linear in the coefficients. They maximise the likelihood of errors as a Gaussian has it, every cloth with equal
weight, with a penalty on their squares in units of the columns' root mean squares:

    mean(log(m + v) + e^2 / (m + v)) + PENALTY / 2 |coefficients|^2

Patches that are hidden almost wholly are left out: a limit of visibility decides whether the truth is 0 there.
The table in use was fitted so to 45 cloths (reports/LOG.md). Times are geometric means of TIMED; ratios count.
"""

import json
from pathlib import Path

import cyclopts
import numpy as np

from jobs.recipe.load import load_recipe
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.fallback import fallback_answers
from pipeline.models.selvage.choice import seconds_of
from pipeline.models.selvage.cloth_numbers import FLOOR, GREY, NODE_LEVELS, colours, numbers_of, probed, probes
from pipeline.models.selvage.errors import CASES, CURVED, OF_CLOTH, RANGES, TERMS, write_terms
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric, load_fabric
from weaves.population import Population, population_fabrics

PENALTY = 3e-4
LARGEST = 4.0  # squared error of twice the colour
TIMED = ("denim", "twill_4_4", "gauze")
PRESETS = "cotton_twill,denim,silk_charmeuse,voile,herringbone,polyester_lining,basket,wool_gabardine,gauze"


def samples(fabric: Fabric, case: int, rows: int, seed: int) -> tuple[np.ndarray, ...]:
    """Return columns (n, terms), squared errors of all answers (n, answers), variances of the truth (n,), relative."""
    behind = bool(case % 2)
    queries = probes(fabric, behind, case >= CURVED, rows, seed)
    truth = estimate(fabric, queries, TruthOptions(relative_error=0.02), seed)
    answers, true = colours(fabric, queries), truth.mean @ GREY
    squares = np.minimum(((answers - true[:, None]) / (true + FLOOR)[:, None]) ** 2, LARGEST)
    variance = (np.linalg.norm(truth.standard_error * GREY, axis=1) / (true + FLOOR)) ** 2
    terms, kinds = np.empty((TERMS, len(true)), np.float32), np.empty(len(true), np.int64)
    write_terms(queries, 0, terms, kinds)
    of_cloth = [number * terms.T[:, OF_CLOTH] for number in numbers_of(probed(fabric, behind))[1:]]
    seen = truth.mean.any(axis=1) & (answers > 0.0).any(axis=1)
    return np.concatenate([terms.T, *of_cloth], axis=1)[seen], squares[seen], variance[seen]


def fitted(columns: np.ndarray, squares: np.ndarray, variance: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the coefficients of the columns (n, c) for squared errors (n,), by Fisher's scoring."""
    scale = np.sqrt((columns**2).mean(axis=0))
    columns, weights = columns / np.where(scale > 0.0, scale, 1.0), weights / weights.sum()
    found = np.zeros(columns.shape[1])
    found[0] = np.log(max(weights @ (squares - variance), 1e-5))
    penalty = np.where(np.arange(len(found)) > 0, PENALTY, 0.0)

    def mean(coefficients: np.ndarray) -> np.ndarray:
        return np.exp(np.clip(columns @ coefficients, -16.0, 2.0))

    def loss(coefficients: np.ndarray) -> float:
        total = mean(coefficients) + variance
        return float(weights @ (np.log(total) + squares / total) + 0.5 * penalty @ coefficients**2)

    for _ in range(40):
        total = mean(found) + variance
        share = mean(found) / total
        slope = columns.T @ (weights * share * (1.0 - squares / total)) + penalty * found
        bend = (columns * (weights * share**2)[:, None]).T @ columns + np.diag(penalty + 1e-6)
        step, size = np.linalg.solve(bend, slope), 1.0
        while loss(found - size * step) > loss(found) and size > 1e-4:
            size *= 0.5
        found = found - size * step
    return found / np.where(scale > 0.0, scale, 1.0)


def main(presets: str = PRESETS, random: int = 12, rows: int = 768, seed: int = 31, out: Path | None = None) -> None:
    """Fit the table; write it and the seconds to `out`, if named, and print the root mean squares of the errors."""
    dataset = load_recipe("standard").dataset
    cloths = [load_fabric(name) for name in presets.split(",") if name]
    usual = Population(families=dataset.unseen_population.families, balanced=True, solid=0.5)
    for population in (dataset.unseen_population, dataset.population, usual):
        cloths += population_fabrics(population.model_copy(update={"seed": seed, "count": random}))
    table, ranges = [], []
    for case in range(CASES):
        parts = [samples(cloth, case, rows, seed + index) for index, cloth in enumerate(cloths)]
        columns, squares, variance = (np.concatenate(part) for part in zip(*parts, strict=True))
        numbers = columns[:, [0, *range(TERMS, columns.shape[1], len(OF_CLOTH))]]
        ranges.append(np.round([numbers.min(axis=0), numbers.max(axis=0)], 4).tolist())
        weights = np.concatenate([np.full(len(part[0]), 1.0 / len(part[0])) for part in parts])
        answers = len(NODE_LEVELS) + (case < CURVED)  # of curved cloth the fallback is never taken
        table.append([fitted(columns, squares[:, one], variance, weights) for one in range(answers)])
        errors = np.sqrt(np.maximum(weights @ (squares - variance[:, None]) / weights.sum(), 0.0))
        print(f"case {case}: errors", " ".join(f"{error:.2%}" for error in errors))
    if out is not None:
        levels = [*(SoftNodes(level).predict for level in NODE_LEVELS), fallback_answers]
        times = [1e6 * seconds_of(np.arange(RANGES * CASES), levels, load_fabric(name)) for name in TIMED]
        means = np.exp(np.log(times).mean(axis=0)).round(3).tolist()
        errors = [[[float(f"{x:.5g}") for x in row] for row in rows] for rows in table]
        found = {"errors": errors, "numbers": ranges[:CURVED], "microseconds": means}
        out.write_text(json.dumps(found).replace("], [", "],\n [") + "\n", encoding="utf-8")


if __name__ == "__main__":
    cyclopts.run(main)
