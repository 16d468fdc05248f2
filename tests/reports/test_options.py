import subprocess
import sys
from typing import get_args

import pytest
from pydantic import ValidationError

from pipeline.models.runtimes import RUNTIMES
from reports.options import BenchOptions, RuntimeName


@pytest.mark.parametrize(
    "change",
    [{"timing_repeats": 19}, {"frames": 2}, {"views": ()}, {"views": ("sofa",)}, {"sphere_size": (0, 8)}, {"x": 1}],
)
def test_what_cannot_be_measured_is_refused(change):
    with pytest.raises(ValidationError):
        BenchOptions.model_validate(change)


def test_options_load_nothing_heavy():
    heavy = ("numba", "pyarrow", "scipy", "torch", "matplotlib", "pandas", "OpenEXR")
    code = f"import sys, reports.options; print([name for name in {heavy} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_names_of_runtimes_are_those_of_the_models():
    assert set(RUNTIMES) == set(get_args(RuntimeName))
