"""What is made anew when a version is raised."""

import pytest

from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from pipeline import versions
from reports import catalogue


def changed_by(version, path, monkeypatch):
    """Return the titles of the tasks whose identity changes when a version is raised."""
    before = plan(load_recipe(path))
    module = catalogue if version == "BENCH" else versions
    monkeypatch.setattr(module, version, getattr(module, version) + 1)
    after = plan(load_recipe(path))
    return [one.title for one, two in zip(before, after, strict=True) if one.id != two.id]


@pytest.fixture
def path(files):
    more = 'bounds = true\nlive = { fabrics = ["denim"] }\nscenes = { names = ["sphere"] }'
    return files.exchange("frames = 4", f"frames = 4\n{more}").write()


def test_what_is_measured_on_scenes_has_a_version_of_its_own(path, monkeypatch):
    changed = changed_by("SCENE_BENCH", path, monkeypatch)
    assert "scene truth of sphere" in changed and "scene errors of point_sampled, sphere, k = 1" in changed
    assert all("scene" in title or "frame time" in title or title.startswith("page") for title in changed)


def test_answers_of_the_fallback_have_a_version_of_their_own(path, monkeypatch):
    changed = changed_by("FALLBACK", path, monkeypatch)
    expected = {"scene truth of sphere", "scene errors of point_sampled, sphere, k = 1", "frame time of sphere"}
    assert expected < set(changed) and "errors of point_sampled, denim" not in changed


@pytest.mark.parametrize(
    "version", ["BENCH", *(name for name in vars(versions) if name.isupper() and name != "MODELS")]
)
def test_every_version_changes_some_identity(path, monkeypatch, version):
    changed = changed_by(version, path, monkeypatch)
    assert changed[0] == "live page of denim" if version == "VIEWER" else changed
