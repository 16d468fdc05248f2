import pytest

from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from pipeline import versions
from reports import catalogue
from tests.jobs.identities import assert_changed

CHANGED = {
    "BENCH": "^bench (?!extremes|live)|^report",
    "TRUTH": "",
    "TRAINING": "^train|woven|neumip|timing|frame time|^report",
    "BOUND": "^bench errors|timing|^report",
    **dict.fromkeys(("SCENES", "SCENE_BENCH"), "scene|frame time|^report"),
    "FALLBACK": "scene|frame time|path_traced|^report",
    "MITSUBA": "path_traced|^report",
    "VIEWER": "live|^report",
    "EXTREMES": "extremes|^report",
}


@pytest.mark.parametrize(
    "version", ["BENCH", *(name for name in vars(versions) if name.isupper() and name != "MODELS")]
)
def test_a_version_changes_what_its_code_makes_and_what_is_made_of_it(files, monkeypatch, version):
    more = 'studies = ["path_traced"]\nbounds = true\nlive = { fabrics = ["denim"] }\nscenes = { names = ["sphere"] }'
    path = files.exchange("frames = 4", f"frames = 4\n{more}").write()
    before = plan(load_recipe(path))
    module = catalogue if version == "BENCH" else versions
    monkeypatch.setattr(module, version, getattr(module, version) + 1)
    assert_changed(before, plan(load_recipe(path)), CHANGED[version])
