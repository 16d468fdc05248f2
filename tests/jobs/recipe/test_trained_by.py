import dataclasses

import pytest

from jobs.cli import main
from jobs.plan.dataset import DataSet
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from jobs.verbs import run
from pipeline.shards.manifest import Manifest
from tests.jobs import made_up
from tests.jobs.identities import assert_changed, ids
from tests.refusals import refusal
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

# The same rows of flat cloth, for a general model.
GENERAL = TRAINER[: TRAINER.index("\n[[models]]")].replace("curvature = [0.01, 0.4]", "sigma = [0.05, 8.0]")
GENERAL = GENERAL.replace('"bent"', '"sheer"').replace('"voile"', '"organza"')
GENERAL += '\n[[models]]\nmodel = "woven"\nname = "woven_sheer"\ntransmission = true\n'

SHEER = '\n[[models]]\nname = "woven_sheer"\nrecipe = "sheer.toml"\n'


@pytest.fixture
def asks(files):
    """The recipe `tiny`, which has `curved` trained by the recipe `bent` beside it."""

    def write(trainer=TRAINER, entry=OTHER, name="bent"):
        (files.folder / f"{name}.toml").write_text(trainer, encoding="utf-8")
        files.text = files.recipe.replace("[bench]", f"{entry}\n[bench]")
        return load_recipe(files.write())

    return write


def test_the_other_recipe_says_everything(asks, files):
    """Its options, its seeds, its trainings, and of its rows those alone that are learnt from."""
    trainer = TRAINER.replace('model = "curved"', 'model = "curved"\nseeds = 2')
    plain, recipe = plan(load_recipe(files.write())), asks(trainer)
    other = load_recipe(files.folder / "bent.toml")
    assert recipe.models[-1] == other.models[0] and recipe.models[-1].seeds == 2
    assert recipe.trained_by.keys() == {"curved"} and recipe.trained_by["curved"].name == "bent"
    assert [model.options.name for model in recipe.own_models] == ["woven", "neumip", "point_sampled"]
    tasks, theirs = plan(recipe), plan(other)
    trainings = [task for task in tasks if task.title.startswith("curved")]
    assert trainings == [task for task in theirs if task.title.startswith("curved")] and len(trainings) == 6
    there = [task for task in tasks if task.stage == "generate" and task.products[0].startswith("datasets/bent-")]
    assert {task.id for task in there} == {need for task in trainings for need in task.needs}
    assert not any(" test " in task.title for task in there)
    before = set()
    for task in tasks:
        assert before.issuperset(task.needs) and task.id not in before
        before.add(task.id)
    # This recipe's own rows and trainings stay what they are.
    own = {task.id for task in tasks} - {task.id for task in there}
    assert_changed(plain, [task for task in tasks if task.id in own], "timing|^report")
    with pytest.raises(BadInput, match=r"seeds = 3.*leave it out: the recipe bent says it"):
        asks(trainer, OTHER + "seeds = 3\n")


AGAIN = [
    ("steps = 20", "steps = 21", "curved|timing|^report"),
    ("behind = 0.25", "behind = 0.3", "curved|timing|^report"),
    ('model = "curved"', 'model = "curved"\nhidden = 16', "curved|timing|^report"),
    ('name = "bent"', 'name = "crooked"', "^report"),
    ("frames = 5", "frames = 6", "^$"),
    ("test = 300", "test = 400", "^$"),
    ('model = "neumip"', 'model = "neumip"\nhidden = 16', "^$"),
]


def test_what_is_trained_again(asks):
    before, *after = (
        [task for task in plan(asks(text)) if task.stage != "generate"]
        for text in (TRAINER, *(TRAINER.replace(old, new) for old, new, _ in AGAIN))
    )
    for (old, _, changed), tasks in zip(AGAIN, after, strict=True):
        assert TRAINER.count(old) == 1
        assert_changed(before, tasks, changed)


def test_it_is_measured_where_it_was_taught_and_the_page_says_where_not(asks, files):
    files.recipe += '\n[bench.scenes]\nnames = ["curtain", "dinner_table"]\n'
    tasks = plan(asks())
    titles = {task.title: task for task in tasks if task.stage == "bench"}
    about = {"errors of curved, denim", "errors of curved, own", "scene errors of curved, curtain"}
    assert {title for title in titles if "curved" in title} == about | {"extremes of curved"}
    trained = {title.rpartition(" ")[2]: id for title, id in ids(tasks, "^train curved").items()}
    assert titles["errors of curved, denim"].model.needs == (trained["denim"],)
    assert [fabric.name for fabric, _ in titles["extremes of curved"].fabrics] == ["denim"]
    notes = {note.name: note.about for note in tasks[-1].models}
    assert "trained by the recipe bent, on queries of its own" in notes["curved"]
    where = "left out on twill_4_4, in the scene dinner_table"
    assert notes["curved"].endswith(f"{where}: it was not trained on that cloth")
    assert "left out in the scene curtain, in the scene dinner_table: " in notes["neumip"]
    assert "left out" not in notes["woven"] + notes["point_sampled"]
    assert set(trained.values()) < set(titles["timing of all methods"].needs)


def test_rows_of_both_recipes_are_made_once_and_lie_in_both_folders(tmp_path, monkeypatch):
    """The other recipe has the same rows of denim and of the twill: one task, two files, and a manifest in each."""
    monkeypatch.setattr(run, "execute", made_up.execute)
    fine, unseen = {"model": "neumip", "name": "fine"}, ["twill_4_4"]
    made_up.write_recipe(tmp_path, "twin", fine, seen=["denim", "voile"], unseen=unseen)
    models = "neumip", {"name": "fine", "recipe": "twin.toml"}
    path = made_up.write_recipe(tmp_path, "tiny", *models, seen=["denim", "basket"], unseen=unseen)
    tasks = plan(load_recipe(path))
    products = [path for task in tasks for path in task.products]
    assert len({task.id for task in tasks}) == len(tasks) and len(set(products)) == len(products)
    rows = [task for task in tasks if task.stage == "generate"]
    shared = [task.products for task in rows if len(task.products) == 2]
    assert {task.shard.fabric.name for task in rows if task.products in shared} == {"denim", "twill_4_4"}
    assert all(a.startswith("datasets/tiny-") and b.startswith("datasets/twin-") for a, b in shared)
    out = tmp_path / "out"
    assert main(["generate", str(path), "--out", str(out)]) == 0
    assert all(Ledger(out).state(task) == "done" for task in rows)
    assert all((out / a).read_bytes() == (out / b).read_bytes() for a, b in shared)
    for name, splits in (("tiny", {"train", "validation", "test"}), ("twin", {"train", "validation"})):
        (folder,) = (out / "datasets").glob(f"{name}-*")
        manifest = Manifest.load(folder)
        assert manifest.name == name and {shard.split for shard in manifest.shards} == splits
        assert {shard.file for shard in manifest.shards} == {path.name for path in folder.glob("*.parquet")}


def test_models_taught_elsewhere_need_test_rows_alone_and_may_come_by_way_of_a_third_recipe(asks, files):
    recipe = asks()
    alone = dataclasses.replace(recipe, models=recipe.models[-1:])
    assert {part.shard.split for part in DataSet(alone).shards} == {"test"}
    asks()
    middle = files.recipe.replace('name = "tiny"', 'name = "middle"').replace("[bench]", f"{OTHER}\n[bench]")
    entry = '\n[[models]]\nname = "curved"\nrecipe = "middle.toml"\n'
    assert asks(middle, entry, "middle").trained_by["curved"].name == "bent"


def test_ways_to_run_are_this_recipes_to_say(asks, files):
    files.recipe = files.recipe.replace("frames = 4", 'frames = 4\nruntimes = ["onnx", "eager-bf16"]')
    every, none = plan(asks()), plan(asks(entry=OTHER + "runtimes = []\n"))
    timed = [task for task in (*every, *none) if task.group == "timing of all methods"]
    assert [task.models[-1].ways.runtimes for task in timed] == [("onnx", "eager-bf16"), ()]
    assert_changed(every, none, "errors of curved|timing|^report")


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
    sentence = refusal(asks, entry=f"\n[[models]]\n{entry}\n")
    assert all(word in sentence for word in words)


PROJECTED = 'normaliser = "projected" }\n'
PROJECTED += f"[bench]\ntruth = {{ {PROJECTED}frame_truth = {{ {PROJECTED}"


@pytest.mark.parametrize(
    ("trainer", "words"),
    [
        (TRAINER + '\n[[models]]\nmodel = "woven"\nrecipe = "tiny.toml"\n', "for one another: tiny → bent → tiny"),
        (TRAINER.replace('"own.toml"', '"other/own.toml"'), "another cloth is called own there"),
        (GENERAL.replace("relative_error = 0.1 }\n", PROJECTED),
         "normaliser = 'visible': must be that of the recipe sheer, 'projected'"),
        (GENERAL.replace('"own.toml", ', ""), "trained there on own, which is seen here"),
        (GENERAL.replace('"organza"]', '"twill_4_4"]'), "on twill_4_4, of the draft of twill_4_4, unseen here"),
    ],
)  # fmt: skip
def test_a_recipe_that_does_not_fit_is_refused(asks, files, trainer, words):
    """A circle, another cloth of the same name, other physics, and for a general model other fabrics."""
    (files.folder / "other").mkdir()
    (files.folder / "other" / "own.toml").write_text(files.fabric.replace("roughness = 0.3", "roughness = 0.31"))
    assert words in refusal(asks, trainer, *(() if trainer.startswith(TRAINER[:15]) else (SHEER, "sheer")))


def test_a_general_model_from_elsewhere_is_measured_on_every_fabric(asks):
    tasks = plan(asks(GENERAL, SHEER, "sheer"))
    (training,) = ids(tasks, "^train woven_sheer").values()
    measured = [task for task in tasks if task.title.startswith("errors of woven_sheer, ")]
    assert [task.model.needs for task in measured] == [(training,)] * 3


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
