from typing import get_args

from pipeline.models.runtimes import RUNTIMES
from reports.options import RuntimeName


def test_the_names_of_runtimes_are_those_of_the_models():
    assert set(RUNTIMES) == set(get_args(RuntimeName))
