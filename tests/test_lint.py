"""The checks of `make lint` can fail."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.lint import architecture, budgets, words
from tests.lint.tree import ROOT, Source


def source(text, module="pipeline.truth.made_up"):
    return Source(Path(f"{module.rpartition('.')[2]}.py"), module, text)


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("from weaves.fabric import Fabric", 0),
        ("from pipeline.truth import query", 0),
        ("def f():\n    from pipeline.shards.schema import SCHEMAS", 1),
        ("import twillight", 1),
        ("import pyarrow.parquet", 1),
        ("from .query import Queries", 1),
    ],
)
def test_imports_point_upstream(text, wrong):
    assert len(list(architecture.wrong_imports(source(text)))) == wrong


def test_a_test_imports_nothing_from_rooms_after_its_own():
    text = "from reports.record import Record\nfrom pipeline.shards.queries import Frame"
    wrong = list(architecture.wrong_imports_of_test(source(text, "tests.pipeline.truth.test_made_up")))
    assert len(wrong) == 1 and "reports.record" in wrong[0]


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("see pipeline.truth.query", []),
        ("`pipeline.truth.query.Queries.take`, then", []),
        ("`pipeline.truth.query.Queries.nothing`", ["pipeline.truth.query.Queries.nothing"]),
        ("(pipeline.truth.sums)", ["pipeline.truth.sums"]),
        ("`kernels.SMOOTH`", []),
        ("`kernels.ROUGH`", ["kernels.ROUGH"]),
        ("tests/fits and pipeline/atomic.py.", []),
        ("tests/fit", ["tests/fit"]),
    ],
)
def test_names_in_docstrings_and_comments_exist(text, wrong):
    assert architecture.missing_names(text) == wrong


@pytest.mark.parametrize(
    ("check", "text", "wrong"),
    [
        (words.wrong_names, "teacher_of", 1),
        (words.wrong_names, "knobs", 1),
        (words.wrong_names, "stand_in", 1),
        (words.wrong_names, "_placed", 1),
        (words.wrong_names, "errors", 0),
        (words.wrong_prose, "Queries that it was not taught.", 1),
        (words.wrong_prose, "The column `asked`.", 0),
        (words.wrong_prose, "A task is given.", 0),
    ],
)
def test_names_and_prose_use_the_terms_of_the_field(check, text, wrong):
    assert len(list(check(text))) == wrong


def test_lines_of_code_are_counted_without_imports_docstrings_and_comments():
    text = '"""A module."""\n\nfrom a import (\n    b,\n)\n\n# why\nx = 1  # one\n\n\n'
    text += 'def f():\n    """Nothing."""\n    return (\n        b\n    )\n'
    assert source(text).lines_of_code == 5


def test_a_budget_that_is_exceeded_is_named(monkeypatch):
    monkeypatch.setattr(budgets, "measured", lambda: {"files": ("files", 10**9), "steps": ("steps", 0)})
    text, exceeded = budgets.table()
    assert "1,000,000,000" in text and len(exceeded) == 1 and exceeded[0].startswith("files: ")


@pytest.mark.parametrize(
    ("code", "more"),
    [
        ("from jobs.cli import main; main(['--help']); import jobs.plan.plan, jobs.recipe.load", ()),
        ("from jobs.cli import main; main(['list'])", ("scipy",)),
        ("import twillight", ("scipy",)),
    ],
    ids=["help and plan", "list", "door"],
)
def test_help_plans_lists_and_the_door_load_no_heavy_library(code, more):
    """`twillight --help` answers in under 0.5 s because nothing heavy is imported; numpy alone takes 0.1 s."""
    heavy = sorted({*architecture.HOMES, *more} - {"cyclopts", "rich"})
    check = f"import sys; print('loaded:', *(name for name in {heavy} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", f"{code}; {check}"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "loaded:"


def test_make_test_has_as_many_tests_as_its_budget_at_most():
    """Of the whole lane that is running, or that ran last."""
    assert budgets.tests() <= budgets.limits()["tests"]
