"""What all tests share: one cache of compiled kernels, the lane of programs that are started, the order."""

import gc
import os
import sys
from functools import partial
from pathlib import Path

import pytest
from hypothesis import settings

ROOT = Path(__file__).parents[1]

# Processes that tests start, also those in copies of the tree, read the kernels that this tree has compiled.
os.environ.setdefault("NUMBA_CACHE_DIR", str(ROOT / "pipeline" / "compiled" / "__pycache__"))

# Examples depend on the test alone, on no load: what passes once passes again.
settings.register_profile("fixed", derandomize=True, deadline=None)
settings.load_profile("fixed")

gc.disable()  # until all tests are collected: their modules stay, and need not be looked through

STARTED = {"cpp", "programs", "webgl", "llvm", "switch"}
"""Fixtures that start a compiler, a browser or a server: what uses one is `external`."""

FIRST = (
    "tests/jobs/verbs/test_render.py", "tests/jobs/recipe/", "tests/jobs/plan/", "tests/jobs/run/", "tests/weaves/",
    "tests/pipeline/models/", "tests/pipeline/analytic/", "tests/pipeline/truth/", "tests/pipeline/training/",
    "tests/reports/",
)  # fmt: skip
"""The order of tests: one process compiles most kernels while another does tests without kernels; then the long ones,
so that no core waits for one at the end."""

QUICK = "not slow and not faults and not external"
"""The lane of `make test`, whose number of tests has a budget."""


@pytest.fixture(scope="session", autouse=True)
def _small_tables(pytestconfig):
    """Make small tables of light between yarns, in `make test` small grids too; return the bytes of usual ones."""
    from pipeline.analytic.bounces.table import bounce_table
    from pipeline.analytic.soft_nodes import nodes
    from pipeline.scenes import bounces

    with pytest.MonkeyPatch.context() as patch:
        usual = nodes._GRID_BYTES
        patch.setattr(nodes, "_GRID_BYTES", 1 << 18 if pytestconfig.option.markexpr == QUICK else usual)
        for name, through in (("_TABLES", False), ("_TABLES_THROUGH", True)):
            patch.setattr(bounces, name, bounces.PerFabric(partial(bounce_table, walks=1 << 10, through=through)))
        yield usual


@pytest.fixture(scope="module")
def coarse_truth():
    """Give tables of the truth 32 azimuths, for tests in which its accuracy plays no part."""
    from pipeline.truth.node_table.tables import COARSE, FINE

    with pytest.MonkeyPatch.context() as patch:
        for table in (FINE, COARSE):
            patch.setattr(table, "_azimuths", 32)
            patch.setattr(table, "_tables", {})
        yield


@pytest.fixture
def described_here(monkeypatch, tmp_path):
    """Describe code here: a process of its own for each is in tests/pipeline/models/added/test_apart.py."""
    from pipeline.models.added import describe as describe_module

    monkeypatch.setattr(describe_module, "run_apart", lambda work, *given, limits: work(*given, lambda share: None))
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(str(tmp_path)):
            del sys.modules[name]


def pytest_itemcollected(item):
    if STARTED.intersection(getattr(item, "fixturenames", ())):
        item.add_marker(pytest.mark.external)


def pytest_collection_modifyitems(items):
    order = {start: index for index, start in enumerate(FIRST)}
    items.sort(key=lambda item: next((order[start] for start in FIRST if item.nodeid.startswith(start)), len(FIRST)))


def pytest_collection_finish(session):
    """Note the number of tests when the whole lane is collected; tests/test_lint.py compares it with its budget."""
    gc.freeze()
    gc.set_threshold(20_000)  # a tenth of the time went into looking through modules and tests for garbage
    gc.enable()
    config = session.config
    if config.args_source is config.ArgsSource.TESTPATHS and config.option.markexpr == QUICK:
        config.cache.set("budgets/tests", len(session.items))
