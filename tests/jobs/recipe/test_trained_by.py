"""Models that another recipe trains: whose rows, whose trainings, what is refused."""

import dataclasses

import pytest

from jobs.cli import main
from jobs.plan.dataset import DataSet
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from pipeline.shards.manifest import Manifest
from weaves.errors import BadInput

TRAINER = """
name = "bent"

[dataset]
seen = ["denim", "own.toml", "voile"]
shard_rows = 1000
seed = 9
rows = { train = 1500, validation = 200, test = 300 }
queries = { curvature = [0.01, 0.4], behind = 0.25 }
truth = { relative_error = 0.1 }

[[models]]
model = "curved"
training = { steps = 20 }

[[models]]
model = "neumip"
ignore_curvature = true

[bench]
frames = 5
"""
OTHER = '\n[[models]]\nmodel = "curved"\nrecipe = "bent.toml"\n'

GENERAL = """
name = "sheer"

[dataset]
seen = ["denim", "own.toml", "organza"]
shard_rows = 1000
seed = 9
rows = { train = 1500, validation = 200, test = 300 }
queries = { sigma = [0.05, 8.0], behind = 0.25 }
truth = { relative_error = 0.1 }

[[models]]
model = "woven"
name = "woven_sheer"
transmission = true
"""

FINE = '\n[[models]]\nmodel = "neumip"\nname = "fine"\nrecipe = "twin.toml"\n'
SHEER = '\n[[models]]\nname = "woven_sheer"\nrecipe = "sheer.toml"\n'


@pytest.fixture
def asks(files):
    """The recipe `tiny`, which has `curved` trained by the recipe `bent` beside it."""

    def write(trainer=TRAINER, entry=OTHER, name="bent"):
        (files.folder / f"{name}.toml").write_text(trainer, encoding="utf-8")
        files.text = files.recipe.replace("[bench]", f"{entry}\n[bench]")
        return load_recipe(files.write())

    return write


def ids(tasks, stage, word=""):
    return [task.id for task in tasks if task.stage == stage and word in task.title]


def test_seeds_are_those_of_the_other_recipe(asks, files):
    trainer = TRAINER.replace('model = "curved"', 'model = "curved"\nseeds = 2')
    recipe = asks(trainer)
    assert recipe.models[-1].seeds == 2
    own = ids(plan(load_recipe(files.folder / "bent.toml")), "train", "curved")
    assert ids(plan(recipe), "train", "curved") == own and len(own) == 6
    with pytest.raises(BadInput, match=r"seeds = 3.*leave it out: the recipe bent says it"):
        asks(trainer, OTHER + "seeds = 3\n")


def test_the_other_recipe_says_everything(asks, files):
    recipe = asks()
    assert recipe.models[-1] == load_recipe(files.folder / "bent.toml").models[0]
    assert recipe.trained_by.keys() == {"curved"} and recipe.trained_by["curved"].name == "bent"
    assert [model.options.name for model in recipe.own_models] == ["woven", "neumip", "point_sampled"]


def test_the_trainings_are_those_of_the_other_recipe(asks, files):
    tasks, own = plan(asks()), plan(load_recipe(files.folder / "bent.toml"))
    taught = ids(tasks, "train", "curved")
    assert taught == ids(own, "train", "curved") and len(taught) == 3
    trainings = {task.id: task for task in tasks if task.stage == "train"}
    theirs = {task.id: task for task in own}
    for key in taught:
        assert trainings[key] == theirs[key] and trainings[key].dataset.startswith("datasets/bent-")
    # Of its rows those alone that are learnt from.
    there = {task.id for task in tasks if task.stage == "generate" and task.products[0].startswith("datasets/bent-")}
    assert there == {need for key in taught for need in trainings[key].needs}
    assert not there & {task.id for task in own if " test " in task.title}
    before = set()
    for task in tasks:
        assert before.issuperset(task.needs) and task.id not in before
        before.add(task.id)


def test_this_recipes_own_rows_and_trainings_stay_what_they_are(asks, files):
    plain = plan(load_recipe(files.write()))
    tasks = plan(asks())
    own = [task for task in tasks if task.stage == "generate" and not task.products[0].startswith("datasets/bent-")]
    assert [task.id for task in own] == ids(plain, "generate")
    assert set(ids(plain, "train")) < set(ids(tasks, "train"))
    for title in ("errors of woven, denim", "errors of point_sampled, own", "truth noise of twill_4_4"):
        assert ids(tasks, "bench", title) == ids(plain, "bench", title)


@pytest.mark.parametrize(
    ("old", "new", "retrained"),
    [
        ("steps = 20", "steps = 21", True),
        ("behind = 0.25", "behind = 0.3", True),
        ('model = "curved"', 'model = "curved"\nhidden = 16', True),
        ('name = "bent"', 'name = "crooked"', False),
        ("frames = 5", "frames = 6", False),
        ("test = 300", "test = 400", False),
        ('model = "neumip"', 'model = "neumip"\nhidden = 16', False),
    ],
)
def test_what_is_trained_again(asks, old, new, retrained):
    assert TRAINER.count(old) == 1
    before, after = plan(asks()), plan(asks(TRAINER.replace(old, new)))
    assert (ids(before, "train", "curved") != ids(after, "train", "curved")) == retrained
    assert ids(before, "train", "woven") == ids(after, "train", "woven")
    changed = ids(before, "bench", "errors of curved, denim") != ids(after, "bench", "errors of curved, denim")
    assert changed == retrained
    assert ids(before, "bench", "errors of woven, denim") == ids(after, "bench", "errors of woven, denim")


def test_it_is_measured_where_it_was_taught_and_the_page_says_where_not(asks, files):
    files.recipe += '\n[bench.scenes]\nnames = ["curtain", "dinner_table"]\n'
    tasks = plan(asks())
    titles = {task.title: task for task in tasks if task.stage == "bench"}
    measured = [name for name in ("denim", "own", "twill_4_4") if f"errors of curved, {name}" in titles]
    assert measured == ["denim", "own"]
    assert list(titles["errors of curved, denim"].model.needs) == ids(tasks, "train", "curved on denim")
    assert "scene errors of curved, curtain" in titles and "errors in the scene of curved, dinner_table" not in titles
    assert [fabric.name for fabric, _ in titles["extremes of curved"].fabrics] == ["denim"]
    notes = {note.name: note.about for note in tasks[-1].models}
    assert "trained by the recipe bent, on queries of its own" in notes["curved"]
    where = "left out on twill_4_4, in the scene dinner_table"
    assert notes["curved"].endswith(f"{where}: it was not trained on that cloth")
    assert "left out in the scene curtain, in the scene dinner_table: " in notes["neumip"]
    assert "left out" not in notes["woven"] + notes["point_sampled"]
    assert set(ids(tasks, "train", "curved")) < set(titles["timing of all methods"].needs)


def test_rows_of_both_recipes_are_made_once_and_lie_in_both_folders(asks, files):
    """The other recipe has the same rows of denim: one task, two files."""
    same = files.recipe.replace('name = "tiny"', 'name = "twin"').replace('"own.toml"]', '"voile"]')
    same = same.replace('model = "neumip"', 'model = "neumip"\nname = "fine"')
    recipe = asks(same, FINE, "twin")
    tasks = plan(recipe)
    assert len({task.id for task in tasks}) == len(tasks)
    products = [path for task in tasks for path in task.products]
    assert len(set(products)) == len(products)
    shared = [task for task in tasks if task.stage == "generate" and len(task.products) == 2]
    assert {task.shard.fabric.name for task in shared} == {"denim", "twill_4_4"}
    for task in shared:
        first, second = task.products
        assert first.startswith("datasets/tiny-") and second.startswith("datasets/twin-")
        assert first.split("/")[-1] == second.split("/")[-1]


@pytest.mark.external
def test_a_shared_shard_is_written_to_both_folders(asks, files, tmp_path):
    """`generate` makes the rows of both recipes; either folder is whole, with a manifest of its own."""
    for old, new in (
        ("train = 2500", "train = 150"),
        ("validation = 100", "validation = 70"),
        ("test = 500", "test = 70"),
        ("count = 3", "count = 0"),
        ("relative_error = 0.05", 'estimator = "owen"\nrelative_error = 0.5\nmax_count = 256'),
    ):
        files.recipe = files.recipe.replace(old, new)
    twin = files.recipe.replace('name = "tiny"', 'name = "twin"').replace('"neumip"', '"neumip"\nname = "fine"')
    asks(twin, FINE, "twin")
    out = tmp_path / "out"
    assert main(["generate", str(files.path), "--out", str(out), "--workers", "1"]) == 0
    ledger = Ledger(out)
    tasks = [task for task in plan(load_recipe(files.path)) if task.stage == "generate"]
    assert all(ledger.state(task) == "done" for task in tasks)
    for task in tasks:
        assert len({(out / path).read_bytes() for path in task.products}) == 1
    for name, splits in (("tiny", {"train", "validation", "test"}), ("twin", {"train", "validation"})):
        (folder,) = (out / "datasets").glob(f"{name}-*")
        manifest = Manifest.load(folder)
        assert manifest.name == name and {shard.split for shard in manifest.shards} == splits
        assert {shard.file for shard in manifest.shards} == {path.name for path in folder.glob("*.parquet")}


def test_a_recipe_whose_models_are_all_taught_elsewhere_draws_test_rows_alone(asks):
    recipe = asks()
    alone = dataclasses.replace(recipe, models=recipe.models[-1:])
    assert {part.shard.split for part in DataSet(alone).shards} == {"test"}


def test_a_recipe_may_pass_on_what_a_third_one_trains(asks, files):
    asks()
    middle = files.recipe.replace('name = "tiny"', 'name = "middle"').replace("[bench]", f"{OTHER}\n[bench]")
    entry = '\n[[models]]\nname = "curved"\nrecipe = "middle.toml"\n'
    recipe = asks(middle, entry, "middle")
    assert recipe.trained_by["curved"].name == "bent"


def test_ways_to_run_are_this_recipes_to_say(asks, files):
    files.recipe = files.recipe.replace("frames = 4", 'frames = 4\nruntimes = ["onnx", "eager-bf16"]')
    every = asks()
    none = asks(entry=OTHER + "runtimes = []\n")
    assert every.models[-1].measured(every.bench).runtimes == ("onnx", "eager-bf16")
    assert none.models[-1].measured(none.bench).runtimes == ()
    before, after = plan(every), plan(none)
    assert ids(before, "train") == ids(after, "train")
    for title, same in (("errors of curved, denim", False), ("timing of all", False), ("errors of woven, denim", True)):
        assert (ids(before, "bench", title) == ids(after, "bench", title)) == same


def test_ways_to_run_are_nothing_to_methods_without_a_network(files):
    before = plan(load_recipe(files.write()))
    after = plan(load_recipe(files.exchange("frames = 4", 'frames = 4\nruntimes = ["onnx"]').write()))
    assert ids(before, "bench", "point_sampled on") == ids(after, "bench", "point_sampled on")
    assert ids(before, "bench", "truth noise") == ids(after, "bench", "truth noise")
    assert set(ids(before, "bench", "woven on")).isdisjoint(ids(after, "bench", "woven on"))


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ('model = "curved"\nrecipe = "quik"', ["models.3.recipe = 'quik'", "did you mean 'quick'"]),
        ('model = "curved"\nrecipe = []', ["models.3.recipe = []"]),
        ('model = "curved"\nrecipe = "none.toml"', ["models.3.recipe = 'none.toml'"]),
        ('model = "curvd"\nrecipe = "bent.toml"', ["models.3.model = 'curvd'", "recipe bent", "did you mean 'curved'"]),
        ('model = []\nrecipe = "bent.toml"', ["models.3.model = []", "recipe bent"]),
        ('name = "x"\nmodel = "curved"\nrecipe = "bent.toml"', ["models.3.name = 'x'", "known: curved, neumip"]),
        ('recipe = "bent.toml"', ["models.3.model = None"]),
        ('name = "curved"\nmodel = "woven"\nrecipe = "bent.toml"', ["models.3.model = 'woven'", "curved is curved"]),
        ('model = "curved"\nhidden = 16\nrecipe = "bent.toml"', ["models.3.hidden = 16", "the recipe bent says it"]),
        ('model = "point_sampled"\nrecipe = "quick"', ["models.3.recipe", "nothing to train: leave it out"]),
        ('model = "curved"\nruntimes = ["onx"]\nrecipe = "bent.toml"', ["models.3.runtimes.0 = 'onx'"]),
        ('model = "neumip"\nrecipe = "bent.toml"', ["models = 'neumip'", "names must differ"]),
        ('model = "curved"\nrecipe = "tiny.toml"', ["models.3.recipe", "wait for one another: tiny → tiny"]),
        ('model = "soft_nodes"\nruntimes = []', ["models.3", "no network: leave runtimes out"]),
    ],
)
def test_bad_input_is_one_sentence(asks, entry, words):
    with pytest.raises(BadInput) as caught:
        asks(entry=f"\n[[models]]\n{entry}\n")
    assert "\n" not in str(caught.value) and all(word in str(caught.value) for word in words)


def test_recipes_that_wait_for_one_another(asks):
    back = TRAINER + '\n[[models]]\nmodel = "woven"\nrecipe = "tiny.toml"\n'
    with pytest.raises(BadInput, match="wait for one another: tiny → bent → tiny"):
        asks(back)


def test_another_cloth_of_the_same_name(asks, files):
    (files.folder / "other").mkdir()
    (files.folder / "other" / "own.toml").write_text(files.fabric.replace("roughness = 0.3", "roughness = 0.31"))
    with pytest.raises(BadInput, match="another cloth is called own there"):
        asks(TRAINER.replace('"own.toml"', '"other/own.toml"'))


def test_other_physics(asks):
    shadowless = GENERAL.replace("relative_error = 0.1", "shadows = false")
    shadowless += "\n[bench]\ntruth = { shadows = false }\nframe_truth = { shadows = false }\n"
    with pytest.raises(BadInput, match="shadows = True: must be that of the recipe sheer, False"):
        asks(shadowless, SHEER, "sheer")


def test_a_general_model_from_elsewhere_is_measured_on_every_fabric(asks):
    tasks = plan(asks(GENERAL, SHEER, "sheer"))
    for fabric in ("denim", "own", "twill_4_4"):
        (task,) = [task for task in tasks if task.title == f"errors of woven_sheer, {fabric}"]
        assert list(task.model.needs) == ids(tasks, "train", "woven_sheer")


def test_what_is_seen_and_unseen_holds_for_a_general_model_too(asks):
    with pytest.raises(BadInput, match="trained there on own, which is seen here"):
        asks(GENERAL.replace('"own.toml", ', ""), SHEER, "sheer")
    with pytest.raises(BadInput, match="trained there on twill_4_4, of the draft of twill_4_4, unseen here"):
        asks(GENERAL.replace('"organza"]', '"twill_4_4"]'), SHEER, "sheer")


@pytest.mark.parametrize(
    ("family", "words"),
    [
        ("plain", "trained there on organza, of the draft of unseen_0_plain, unseen here"),
        ("irregular", "unseen_0_irregular: .*: the model woven_sheer was trained on"),
    ],
)
def test_random_unseen_drafts_must_be_new_to_a_general_model_and_their_yarns_known(asks, files, family, words):
    """The trainer knows organza, which is a plain weave, and yarns of relief 1 alone."""
    unseen = f'[dataset.unseen_population]\ncount = 1\nfamilies = ["{family}"]\n\n[dataset.queries]'
    files.recipe = files.recipe.replace("[dataset.queries]", unseen).replace('["twill 4/4"]', '["twill 4/4", "plain"]')
    with pytest.raises(BadInput, match=words):
        asks(GENERAL, SHEER, "sheer")
