"""Programs that are run by hand, at their smallest: tests/fits and tests/scale."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("fits/fit_calibration.py --fabrics 1 --rows 4 --estimator node_table", "transparency, QUADRATURE_CURVED: too"),
        ("fits/fit_node_table_error.py --fabrics 1 --queries 4 --points 256", "SMOOTH: fitted"),
        ("fits/fit_quadrature.py --rows 1", "SAFETY: fitted"),
        ("fits/fit_selvage_errors.py --presets denim --random 0 --rows 32", "case 3: errors"),
        ("scale/measure_driver.py --tasks 3", "| 3 |"),
        ("scale/measure_rows.py --rows 1000", "| 1,000 | read |"),
    ],
    ids=lambda words: words.split()[0],
)
def test_a_program_runs_and_prints_its_table(command, words):
    script, *options = command.split()
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    run = [sys.executable, str(ROOT / "tests" / script), *options]
    assert words in subprocess.run(run, env=environment, capture_output=True, text=True, check=True).stdout
