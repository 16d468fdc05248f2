import json

import pytest

from jobs.plan.measurements.fabrics import AtExtremes
from jobs.recipe.load import load_recipe
from jobs.recipe.shipped import recipe_names
from pipeline.scenes.catalogue import load_scene
from tests.refusals import refusal
from weaves.fabric import load_fabric


def test_recipes_of_the_package_load_and_trade_trains_the_published_woven_as_long_as_ours():
    for name in recipe_names():
        recipe = load_recipe(name)
        assert recipe.name == name and recipe.about
    recipe = load_recipe("trade")
    published = next(one for one in recipe.models if one.options.name == "woven_published")
    ours = next(one for one in load_recipe("standard").models if one.options.name == "woven")
    assert "maps of 32 texels" in published.options.departures and len(published.options.departures) == 4
    assert published.seeds == ours.seeds == 3
    assert published.training == ours.training and recipe.dataset == load_recipe("standard").dataset


def refused(files, words):
    """Assert that a recipe is refused in one sentence that has all words and the name of the file."""
    sentence = refusal(load_recipe, files.write())
    assert all(word in sentence for word in (*words, ".toml")), sentence


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name = "tiny"', 'name = "a/b"', ["name = 'a/b'", "letters"]),
        ('"denim"', '"denin"', ["dataset.seen.0 = 'denin'", "did you mean 'denim'"]),
        ('"own.toml"', '"missing.toml"', ["dataset.seen.1 = 'missing.toml'"]),
        ('"own.toml"', '"denim"', ["dataset = 'denim'", "names must differ"]),
        ("sigma = [0.05, 8.0]", "sigma = [0.0, 8.0]", ["dataset.queries = ", "0 < low"]),
        ("relative_error = 0.05", "relative_error = inf", ["dataset.truth.relative_error = inf", "finite"]),
        ("relative_error = 0.05", "max_count = 100", ["dataset.truth", "power of two"]),
        ("relative_error = 0.05", '[dataset.training_truth]\nfootprint = "box"',
         ["dataset.training_truth.footprint = 'box'", "must be that of dataset.truth, 'gaussian'"]),
        ("sigma = [0.05, 8.0]\n\n[dataset.truth]", 'sigma = [0.03, 8.0]\n\n[dataset.truth]\nestimator = "node_table"',
         ["dataset.truth.estimator = 'node_table'", "footprints from 0.0391 yarn spacings on"]),
        ("frames = 4", 'truth = { estimator = "node_table" }', ["bench.truth.estimator", "pictures", "'auto'"]),
        ("frames = 4", 'frame_truth = { normaliser = "projected" }',
         ["bench.frame_truth.normaliser", "dataset.truth, 'visible'"]),
        ('model = "neumip"', 'model = "unified_btf"\ntruth = { normaliser = "projected" }',
         ["models.1.truth.normaliser = 'projected'", "must be that of dataset.truth, 'visible'"]),
        ('model = "neumip"', 'model = "unified_btf"\ntexels_per_yarn = 16\ntruth = { estimator = "node_table" }',
         ["models.1.truth.estimator = 'node_table'", "footprints from 0.0391 yarn spacings on"]),
        ("relative_error = 0.05", 'footprint = "box"', ["models.2.footprint = 'gaussian'", "'box'"]),
        ("relative_error = 0.05", "parallax = false", ["models.2.parallax = True", "of dataset.truth, False"]),
        ('model = "woven"', 'model = "wovn"', ["models.0.model = 'wovn'", "did you mean 'woven'"]),
        ('model = "woven"', 'model = "gauss_nodes"', ["models.0.model = 'gauss_nodes'", "gone: take 'soft_nodes'"]),
        ("relative_error = 0.05", 'estimator = "jittered"', ["truth.estimator = 'jittered'", "gone: take 'r2'"]),
        ("counts = [1, 2]", "[models.training]", ["models.2", "nothing to train"]),
        ("counts = [1, 2]", "seeds = 2", ["models.2", "point_sampled has nothing to train: leave seeds out"]),
        ("hidden = 32\n[models.training]", f"seeds = 2\n[models.training]\nseed = {2**63 - 1}",
         ["models.0", "seeds, 2, from training.seed, 9223372036854775807, on"]),
        ('model = "neumip"', 'model = "neumip"\nname = "woven"', ["models = 'woven'", "names must differ"]),
        ('model = "neumip"', 'model = "neumip"\nname = "truth"', ["models.1.name = 'truth'", "must be another name"]),
        ("sigma = [0.05, 8.0]", "behind = 0.5", ["models.0.name = 'woven'", "does not know queries with behind"]),
        ("relative_error = 0.05", 'parallax = false\nframe = "macro"',
         ["dataset.truth.frame = 'macro'", "point_sampled", "'ply' only"]),
        ("frames = 4", 'runtimes = ["onx"]', ["bench.runtimes.0 = 'onx'", "'eager-bf16'", "'onnx' or 'onnx-int8'"]),
        ("frames = 4", 'live = { fabrics = ["satin_8"] }', ["bench.live.fabrics = 'satin_8'", "of the recipe"]),
        ('\n[dataset.truth]\nrelative_error = 0.05\n\n[[models]]\nmodel = "woven"\nhidden = 32',
         'curvature = [0.1, 0.8]\n\n[[models]]\nmodel = "curved"',
         ["models.0.largest_curvature = 0.5: must not be below", "0.8"]),  # the model would refuse the rows
        ("sigma = [0.05, 8.0]", "max_angle = 89.5",
         ["dataset.truth.parallax = True", "within 89 degrees", "max_angle is 89.5"]),
        ("population = 800", "", ["dataset.rows.population = 0", "must be > 0"]),
        ('exclude = ["twill 4/4"]', 'exclude = ["twill 4/5"]', ["dataset.population.exclude = 'twill 4/5'"]),
        ("move = 2", "move = 0", ["own.toml", "draft"]),
    ],
)  # fmt: skip
def test_bad_input_is_one_sentence(files, old, new, words):
    refused(files.exchange(old, new), words)


@pytest.mark.parametrize(
    "network",
    ['model = "neumip"\noffset = false', *(f'model = "{name}"' for name in ("unified_btf", "btf_autoencoder"))],
)
def test_every_network_may_learn_view_rays(files, network):
    """Beside `woven`; and all that is planned, the truth at extremes too, is of these rays."""
    files.exchange('model = "neumip"', network)
    extremes = [task for task in files.plan() if isinstance(task, AtExtremes)]
    assert len(extremes) == 3 and {(task.truth.parallax, task.truth.estimator) for task in extremes} == {(True, "owen")}


def of_the_plane(files):
    """Return the recipe with footprints in the fabric plane, said in each table of truth options."""
    files.exchange("relative_error = 0.05", "parallax = false").exchange("counts = [1, 2]", "parallax = false")
    return files.exchange("frames = 4", "\n".join(f"{key}.parallax = false" for key in ("truth", "frame_truth")))


def test_a_recipe_may_be_of_the_fabric_plane(files):
    """Also methods that have no option for walls, which nothing meets there."""
    recipe = load_recipe(of_the_plane(files).exchange('"neumip"', '"prefiltered"\nparallax = false').write())
    assert (recipe.dataset.truth.parallax, recipe.dataset.truth.walls) == (False, "left_out")


@pytest.mark.parametrize(
    ("network", "words"),
    [
        ('model = "selvage"', ["dataset.truth.parallax = False", "selvage (models.1) knows parallax = True only"]),
        ('model = "unified_btf"', ["models.1.truth.parallax = True", "of dataset.truth, False"]),
    ],
)
def test_what_is_of_view_rays_is_refused_in_the_plane(files, network, words):
    refused(of_the_plane(files).exchange('model = "neumip"', network), words)


def test_the_bound_knows_light_from_behind_but_no_curved_cloth(files):
    files.exchange("frames = 4", "frames = 4\nbounds = true").exchange("sigma = [0.05, 8.0]", "behind = 0.5")
    refused(files, ["models.0.name = 'woven'", "queries with behind"])
    refused(files.exchange("behind = 0.5", "curvature = [0.1, 0.4]"), ["bench.bounds = True", "with curvature"])


def test_a_table_is_refused_for_cloth_of_too_many_cells(files):
    """A stripe that shifts by one pick an end in 9 of 10 picks: no translation carries it onto itself."""
    rows = ["#" + "." * 9, *["#." * 5] * 9]
    files.exchange('family = "satin", ends = 5, move = 2', f'family = "matrix", rows = {json.dumps(rows)}')
    files.exchange("sigma = [0.05, 8.0]", "sigma = [4.0, 8.0]\nmax_angle = 60")
    load_recipe(files.write())
    files.exchange("relative_error = 0.05", 'estimator = "node_table"')
    words = "at most 96 different cells, own has 100; take 'auto'"
    refused(files, ["tiny.toml: dataset.truth.estimator = 'node_table': ", words])
    # Only rows that are asked for count.
    files.text = files.text.replace('"own.toml"]', "]").replace('["twill_4_4"]', '["own.toml"]')
    files.text = files.text.replace('model = "neumip"', 'model = "soft_nodes"')
    files.text = files.text.replace('estimator = "node_table"', '[dataset.training_truth]\nestimator = "node_table"')
    load_recipe(files.write())


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["spere"], ["bench.scenes.names.0 = 'spere'", "did you mean 'sphere'", "known: curtain, dinner_table, drape"]),
        (["sphere", "attic.toml"], ["bench.scenes.names.1 = 'attic.toml'", "beside the recipe"]),
        (["sphere", "sphere"], ["bench.scenes.names.1 = 'sphere'", "must differ"]),
        (["own.toml"], ["own.toml", "unknown key"]),
        (["a\0b.toml"], ["bench.scenes.names.0"]),
        ([""], ["bench.scenes.names.0 = ''"]),
    ],
)
def test_scenes_that_are_not_there_are_one_sentence(files, names, words):
    files.text += f"[bench.scenes]\nnames = {json.dumps(names)}\n"
    refused(files, words)


def test_scenes_beside_the_recipe_are_found_from_anywhere(files, tmp_path, monkeypatch):
    (files.folder / "attic.xml").write_text("<scene version='3.0.0'/>")
    (files.folder / "loft.toml").write_text('name = "loft"\nsource = "attic.xml"\n[cloths.a]\nfabric = "own.toml"\n')
    files.text += '[bench.scenes]\nnames = ["sphere", "attic.xml", "loft.toml"]\n'
    path = files.write()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    names = load_recipe(path).bench.scenes.names
    assert names == ("sphere", str(files.folder / "attic.xml"), str(files.folder / "loft.toml"))
    scene = load_scene(names[2])
    assert load_fabric(scene.cloths["a"].fabric).name == "own" and scene.source.is_file()


def test_the_unseen_draft_must_be_kept_out_of_the_population(files):
    files.exchange('exclude = ["twill 4/4"]', 'families = ["twill"]').exchange("count = 3", "count = 300")
    refused(files, ["must name 'twill 4/4', else the draft of twill_4_4 is seen in training"])


def test_a_random_unseen_draft_may_be_that_of_a_seen_fabric(files):
    """Then only the yarns are unseen, as of a named fabric: a plain weave has one draft."""
    unseen = '[dataset.unseen_population]\ncount = 1\nseed = 7\nfamilies = ["plain", "irregular"]\nbalanced = true\n'
    files.exchange("[dataset.queries]", f"{unseen}\n[dataset.queries]")
    files.exchange('exclude = ["twill 4/4"]', 'families = ["plain"]').exchange('"denim"', '"polyester_lining"')
    recipe = load_recipe(files.write())
    assert recipe.unseen_population[0].weave.canonical() == recipe.population[0].weave.canonical()
    files.exchange('"polyester_lining"', '"denim"')
    words = "exclude = []: must name the draft of unseen_0_plain, which random_000 is trained on"
    refused(files, [f"dataset.unseen_population.{words}", "(Drawn from seed 7: plain"])


@pytest.mark.slow
def test_designs_are_chosen_on_other_cloths_than_those_of_any_page():
    """`ablations` is the recipe for choices of design (CONTRIBUTING.md)."""
    chosen_on = load_recipe("ablations")
    assert len(chosen_on.unseen_population) >= 8 and not chosen_on.unseen
    optics = [fabric.optics() for fabric in chosen_on.unseen_population]
    for name in recipe_names():
        recipe = load_recipe(name)
        if name != "ablations" and recipe.unseen_population:
            assert recipe.dataset.unseen_population.seed != chosen_on.dataset.unseen_population.seed
        if name != "ablations":
            assert not [fabric.name for fabric in recipe.unseen + recipe.unseen_population if fabric.optics() in optics]


@pytest.mark.parametrize("name", ["standard", "full"])
def test_pages_have_eight_random_unseen_fabrics_of_every_kind(name):
    fabrics = load_recipe(name).unseen_population
    assert len(fabrics) >= 8
    for family in ("plain", "compound_twill", "large_satin", "irregular"):
        widths = [fabric.warp.width for fabric in fabrics if fabric.name.endswith(family)]
        assert 1.0 in widths and min(widths) < 1.0
