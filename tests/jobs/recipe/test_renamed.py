"""Recipes with names of earlier versions: one sentence names the file, the key, the value and the new name."""

from typing import get_args

import pytest

from jobs.recipe.load import load_recipe
from pipeline.models.catalogue import CLASSES
from pipeline.models.registry import module_of
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.shipped import SHIPPED
from pipeline.truth.options import EstimatorName
from weaves.errors import BadInput
from weaves.renamed import REMOVED, RENAMED, SCENE, replacement

KNOWN = {"model": set(CLASSES), "estimator": set(get_args(EstimatorName)), SCENE: set(SHIPPED)}


def refusal(files):
    path = files.write()
    with pytest.raises(BadInput) as refused:
        load_recipe(path)
    assert "\n" not in str(refused.value)
    return str(refused.value).split(".toml: ", 1)[1]  # the front of a long path is left out


@pytest.mark.parametrize("kind", ["model", "estimator", SCENE])
def test_old_names_are_gone_and_new_names_exist(kind):
    assert KNOWN[kind].isdisjoint(RENAMED[kind]) and KNOWN[kind].isdisjoint(REMOVED.get(kind, {}))
    assert KNOWN[kind].issuperset(RENAMED[kind].values())


@pytest.mark.parametrize("old", [*RENAMED["model"], *REMOVED["model"]])
def test_old_models(files, old):
    files.exchange('model = "point_sampled"\ncounts = [1, 2]', f'model = "{old}"')
    assert refusal(files) == f"models.2.model = '{old}': {replacement('model', old)}"


@pytest.mark.parametrize("old", RENAMED["model"])
def test_old_models_of_another_recipe(files, old):
    files.exchange('model = "point_sampled"\ncounts = [1, 2]', f'model = "{old}"\nrecipe = "quick"')
    said = f"models.2.model = '{old}': must be a model of the recipe quick; {replacement('model', old)}"
    assert refusal(files) == said


@pytest.mark.parametrize("section", ["dataset.truth", "dataset.training_truth", "bench.truth", "bench.scenes.truth"])
@pytest.mark.parametrize("old", RENAMED["estimator"])
def test_old_estimators(files, old, section):
    files.exchange("[dataset.truth]\nrelative_error = 0.05", f'[{section}]\nestimator = "{old}"')
    if section.startswith("bench"):
        files.exchange("[bench]\nframes = 4", "")
    assert refusal(files) == f"{section}.estimator = '{old}': {replacement('estimator', old)}"


def test_the_removed_geometry_of_the_truth(files):
    files.exchange("[dataset.truth]\nrelative_error = 0.05", '[dataset.truth]\ngeometry = "linear"')
    assert refusal(files).startswith("dataset.truth.geometry = 'linear': unknown key; 'geometry' was removed: ")


@pytest.mark.parametrize("old", RENAMED[SCENE])
def test_old_scenes(files, old):
    files.exchange("frames = 4", f'frames = 4\n[bench.scenes]\nnames = ["{old}"]')
    said = refusal(files)
    assert said.startswith(f"bench.scenes.names.0 = '{old}': ") and said.endswith(replacement(SCENE, old))
    with pytest.raises(BadInput, match=f"'{old}' is now "):
        load_scene(old)


def test_an_old_model_on_the_command_line():
    with pytest.raises(BadInput, match="'sums' is now 'soft_nodes'"):
        module_of("sums")
