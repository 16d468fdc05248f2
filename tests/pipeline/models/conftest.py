"""Weights that every test draws alike, and methods whose tables take long to make, once for all tests."""

import pytest
import torch

from pipeline.models.selvage.model import Selvage


@pytest.fixture(autouse=True)
def _fixed_weights():
    torch.manual_seed(0)


@pytest.fixture(scope="session")
def selvage():
    return Selvage()
