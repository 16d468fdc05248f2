"""The tasks on scenes: what is made anew when what is measured on them changes."""

from jobs.plan import scenes
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe


def test_what_is_measured_on_scenes_has_a_version_of_its_own(files, monkeypatch):
    path = files.exchange("frames = 4", 'frames = 4\nscenes = { names = ["sphere"] }').write()
    before = plan(load_recipe(path))
    monkeypatch.setattr(scenes, "SCENE_BENCH_VERSION", scenes.SCENE_BENCH_VERSION + 1)
    after = plan(load_recipe(path))
    changed = [one.title for one, two in zip(before, after, strict=True) if one.id != two.id]
    assert "truth of the scene sphere" in changed and "point_sampled k = 1 on the scene sphere" in changed
    assert all("scene" in title or "frame of sphere" in title or title.startswith("page") for title in changed)
