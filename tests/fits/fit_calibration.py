"""Fit the factors of pipeline.truth.calibration: reported errors against true ones, stage by stage.

Command: ``python tests/fits/fit_calibration.py [--fabrics 16] [--rows 60] [--estimator auto]``

Random fabrics and queries of all classes of reports.truth.calibration, of another seed than its own. For each stage and
each triple of factors (a, c, b), the ratio rms(error) / rms(standard error) is computed for every class and estimator
with at least `LEAST` answers, and the cover k that `SHARE` of the errors of each class need. The table lists the
triples whose ratios are closest to 1 in the worst class, narrow bounds preferred. Single queries dominate a ratio:
differences below a fifth between classes are chance.

The factors in use lie between the best triples of this grid on two other sets of random fabrics; reports/LOG.md says
which were changed since, and why.
"""

import itertools
import math

import cyclopts
import numpy as np

from pipeline.truth.calibration import COARSE_TABLE, FINE_TABLE, QUADRATURE, QUADRATURE_CURVED, REFINED, SAMPLED
from pipeline.truth.estimator import ESTIMATORS
from pipeline.truth.options import EstimatorName
from reports.truth.calibration import samples

SEED = 2_000
LEAST = 150
SHARE = 0.9975
STAGES = {"COARSE_TABLE": COARSE_TABLE, "FINE_TABLE": FINE_TABLE, "REFINED": REFINED, "SAMPLED": SAMPLED}
STAGES |= {"QUADRATURE": QUADRATURE, "QUADRATURE_CURVED": QUADRATURE_CURVED}
REPORTED = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.4)
LARGEST = (0.03, 0.1, 0.3, math.inf)
MISSED = (0.0, 0.0003, 0.0005, 0.001, 0.0015, 0.002, 0.003, 0.004, 0.006)


Fit = tuple[float, float, float, float, float, dict[str, float]]


def fitted(groups: dict[str, tuple[np.ndarray, ...]]) -> list[Fit]:
    """Return penalty, a, c, b, k and the ratios of each class for every triple of factors, the best first."""
    found = []
    for a, c, b in itertools.product(REPORTED, LARGEST, MISSED):
        ratios, cover = {}, 0.0
        for name, (wrong, reported, doubt, size) in groups.items():
            limited = a * reported / (1.0 + a * reported / (c * np.maximum(size, 1e-12)))
            error = np.hypot(limited, b * size)
            square = max(float(np.mean(wrong**2 - doubt**2)), 1e-30)
            ratios[name] = math.sqrt(square / max(float(np.mean(error**2)), 1e-30))
            beyond = np.maximum(np.abs(wrong) - 3.0 * doubt, 0.0) / np.maximum(error, 1e-12)
            cover = max(cover, float(np.quantile(beyond, SHARE)))
        worst = max(abs(math.log(ratio)) for ratio in ratios.values())
        found.append((worst + 0.15 * math.log(max(cover, 1.0)), a, c, b, cover, ratios))
    return sorted(found, key=lambda one: one[0])


def main(fabrics: int = 16, rows: int = 60, estimator: list[EstimatorName] | None = None) -> None:
    """Print the best factors of each stage, for all estimators if none is named."""
    found = list(samples(fabrics, rows, tuple(estimator or ESTIMATORS), 1 << 15, SEED))
    sides = {"components": (slice(4), False), "components, behind": (slice(4), True)}
    for title, (columns, back) in {**sides, "transparency": (slice(4, 5), False)}.items():
        for stage, number in STAGES.items():
            groups = {}
            for kind, name, behind, answers, exact in found:
                here = (answers.stage == number) & (behind == back)
                if here.sum() >= LEAST:
                    size = np.linalg.norm(answers.mean[here, :4], axis=1, keepdims=True)
                    size = size if columns == slice(4) else (size > 0.0).astype(np.float64)
                    wrong = answers.mean[here, columns] - exact.mean[here, columns]
                    groups[f"{name}, {kind}"] = wrong, answers.error[here, columns], exact.error[here, columns], size
            print(f"\n{title}, {stage}: {', '.join(groups) or 'too few answers'}")
            for _, a, c, b, cover, ratios in fitted(groups)[:5] if groups else ():
                listed = " ".join(f"{one:.2f}" for one in ratios.values())
                print(f"  a {a:.2f}  c {c:g}  b {b:.4f}  k {cover:.1f}  ratios {listed}")


if __name__ == "__main__":
    cyclopts.run(main)
