import pytest

from tests.faults.runs import hashes, run, write_recipe


@pytest.fixture(scope="session")
def recipe(tmp_path_factory):
    return write_recipe(tmp_path_factory.mktemp("recipe"))


@pytest.fixture(scope="session")
def undisturbed(recipe, tmp_path_factory):
    """Products of a run that nothing disturbs, and their hashes."""
    out = tmp_path_factory.mktemp("undisturbed") / "out"
    run(recipe, out)
    return out, hashes(recipe, out)
