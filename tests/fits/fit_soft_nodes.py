"""Fit the constants of soft nodes: widths of horizons' ramps, and deviations at which the way of weighing changes.

Command: ``python tests/fits/fit_soft_nodes.py [--fabrics 6] [--queries 400] [--factor 1.5]``

Each constant is divided and multiplied by a factor, one at a time. Compiled kernels hold their constants, so every
setting runs in a copy of the sources, which has its own cache. The error is the relative RMSE of the colour measure
against `auto` at 1 %, the mean over random fabrics (seed 81); queries (seed 82) have footprints of .02 to 8 yarns.
What was seen is in reports/LOG.md.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cyclopts
import numpy as np

from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from reports.error import COLOUR_WEIGHTS
from weaves.fabric import Fabric
from weaves.population import Population, population_fabrics

ROOT = Path(__file__).parents[2]
ANALYTIC = "pipeline/analytic"
CONSTANTS = {
    "_RAMP": ("soft_horizons.py", r"_RAMP, _RAMP_SLOPE = np\.float32\(([\d.]+)\)"),
    "_RAMP_SLOPE": ("soft_horizons.py", r"_RAMP, _RAMP_SLOPE = np\.float32\([\d.]+\), np\.float32\(([\d.]+)\)"),
    "_TAIL": ("soft_nodes/shade.py", r"_TAIL = np\.float32\(([\d.]+)\)"),
    "RESOLVED": ("soft_nodes/wide.py", r"RESOLVED: Final = ([\d.]+)"),
    "EVEN": ("soft_nodes/nodes.py", r"EVEN: Final = ([\d.]+)"),
}
"""File of each constant below `pipeline.analytic`, and its number as a group of an expression."""


def cloths(fabrics: int, queries: int) -> list[tuple[Fabric, Queries]]:
    options, drawn = QueryOptions(sigma=(0.02, 8.0)), population_fabrics(Population(count=fabrics, seed=81))
    return [(fabric, draw_queries(options, fabric.weave.repeat, 82, 0, queries)) for fabric in drawn]


def answer(fabrics: int, queries: int, out: Path) -> None:
    """Write the colours that soft nodes answer with the constants of these sources."""
    method = SoftNodes()
    np.save(out, [method.predict(*cloth) @ COLOUR_WEIGHTS for cloth in cloths(fabrics, queries)])


def colours_with(folder: Path, name: str, factor: float, size: tuple[int, int]) -> np.ndarray:
    """Return the colours with one constant multiplied by a factor, from a copy of the sources in `folder`."""
    copy = folder / f"{name}-{factor:.3g}"
    for package in ("weaves", "pipeline", "reports", "tests/fits"):
        shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    file, place = CONSTANTS[name]
    path = copy / ANALYTIC / file
    text = path.read_text(encoding="utf-8")
    found = re.search(place, text)
    assert found, f"{name} is not in {path}"
    path.write_text(f"{text[: found.start(1)]}{factor * float(found[1]):.6g}{text[found.end(1) :]}", encoding="utf-8")
    out = copy / "colours.npy"
    command = [sys.executable, "tests/fits/fit_soft_nodes.py", "--fabrics", str(size[0]), "--queries", str(size[1])]
    subprocess.run([*command, "--out", str(out)], cwd=copy, env=os.environ | {"PYTHONPATH": str(copy)}, check=True)
    return np.load(out)


def main(
    fabrics: int = 6,
    queries: int = 400,
    factor: float = 1.5,
    constant: list[str] | None = None,
    out: Path | None = None,
) -> None:
    """Print the errors with each constant changed, or those named; with `out`, only answer, and write the colours."""
    if out:
        answer(fabrics, queries, out)
        return
    truth = TruthOptions(relative_error=0.01)
    drawn = cloths(fabrics, queries)
    exact = np.array([estimate(*cloth, truth, 1).mean @ COLOUR_WEIGHTS for cloth in drawn])

    def error(colours: np.ndarray) -> float:
        squared = np.square(colours - exact).sum(axis=(1, 2)) / np.square(exact).sum(axis=(1, 2))
        return float(np.sqrt(squared).mean())

    in_use = error(np.array([SoftNodes().predict(*cloth) @ COLOUR_WEIGHTS for cloth in drawn]))
    with tempfile.TemporaryDirectory() as folder:
        for name in constant or CONSTANTS:
            file = CONSTANTS[name][0]
            colours = {one: colours_with(Path(folder), name, one, (fabrics, queries)) for one in (1.0 / factor, factor)}
            errors = {1.0: in_use} | {one: error(values) for one, values in colours.items()}
            shown = ", ".join(f"x {one:.2f}: {errors[one]:.2%}" for one in sorted(errors))
            print(f"{name} ({file}): {shown}; best x {min(errors, key=errors.__getitem__):.2f}", flush=True)


if __name__ == "__main__":
    cyclopts.run(main)
