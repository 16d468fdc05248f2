"""Methods from outside in recipes; the tests of what their code may be are in tests/pipeline/models/added."""

from pathlib import Path
from unittest.mock import Mock

import pytest

from jobs.plan.plan import plan
from jobs.plan.training import Training
from jobs.recipe import added
from jobs.recipe.load import load_recipe
from pipeline.models.added import apart
from pipeline.models.added.added_code import GROUP
from pipeline.models.added.guarded import MethodFailed
from reports.record import Record, read_records
from tests.jobs.identities import assert_changed, ids
from tests.pipeline.models.added.test_describe import METRIC
from tests.refusals import refusal
from weaves.errors import BadInput

METHOD = """
class Theirs:
    name, version, setting = "theirs", 3, ""
    covers = prepare = predict = bytes_stored = lambda self, *rest: True
    def __init__(self, rows=8): pass
"""

NETWORK = METHOD + "    network = load = covers\n"

HERE = '\n[[models]]\nmodel = "theirs"\n'


pytestmark = pytest.mark.usefixtures("described_here")


@pytest.fixture
def theirs(tmp_path):
    (tmp_path / "theirs.py").write_text(METHOD)
    return f"{tmp_path / 'theirs.py'}:Theirs"


@pytest.fixture
def planned(files):
    """Return the plan of the recipe as it is now, with methods from outside."""
    return lambda *add: plan(load_recipe(files.write(), add))


THEIRS_ALONE = "timing|^report"
"""What a method from outside changes of the rest."""


def test_a_given_method_is_one_more_model_with_the_options_and_the_name_of_the_recipe(planned, theirs, files):
    before, after = planned(), planned(theirs)
    errors = {f"bench errors of theirs, {name}" for name in ("denim", "own", "twill_4_4")}
    assert ids(after).keys() - ids(before).keys() == errors | {"bench extremes of theirs"}
    assert_changed(before, after, THEIRS_ALONE)
    files.text += HERE + 'name = "other"\nrows = 9\nlimit = 5\nversion = "3"\n'
    first = planned(theirs)
    (task,) = (task for task in first if task.title == "errors of other, denim")
    options = task.model.options
    assert (options.name, options.own, options.limit, options.stated) == ("other", {"rows": 9}, 5.0, "3")
    files.exchange("limit = 5", "limit = 50")
    assert_changed(first, planned(theirs), "^$")
    files.exchange("rows = 9", "rows = 10")
    assert_changed(first, planned(theirs), f"of other|{THEIRS_ALONE}")


@pytest.mark.parametrize("code", [METHOD, NETWORK])
def test_a_changed_file_is_measured_or_trained_again_and_nothing_else(planned, theirs, tmp_path, code):
    (tmp_path / "elsewhere").mkdir()
    for path in (tmp_path / "theirs.py", tmp_path / "elsewhere" / "theirs.py"):
        path.write_text(code)
    before = planned(theirs)
    assert_changed(before, planned(theirs.replace("theirs.py", "elsewhere/theirs.py")), "^$")
    (tmp_path / "theirs.py").write_text(code + "\n")
    assert_changed(before, planned(theirs), f"theirs|{THEIRS_ALONE}")
    assert bool(ids(before, "^train theirs")) == (code == NETWORK)


@pytest.mark.parametrize("one_material", [False, True])
def test_a_network_is_trained_and_measured_of_each_seed(files, planned, theirs, tmp_path, one_material):
    (tmp_path / "theirs.py").write_text(NETWORK + f"    of_one_material = {one_material}\n")
    before = planned()
    files.text += HERE + "rows = 9\nseeds = 2\n[models.training]\nsteps = 20\nseed = 4\n"
    tasks = planned(theirs)
    trained = [task for task in tasks if isinstance(task, Training) and task.options.model == "added"]
    groups = [("denim",), ("own",), ("twill_4_4",)]
    general = [("denim", "own", "random_000", "random_001", "random_002")]
    assert [task.fabrics for task in trained] == 2 * (groups if one_material else general)
    assert [task.training.seed for task in trained] == sorted([4, 5] * (3 if one_material else 1))
    assert {(task.training.steps, task.options.own["rows"]) for task in trained} == {(20, 9)}
    measured = [task for task in tasks if task.stage == "bench" and "theirs" in task.title]
    assert measured and all({task.id for task in trained} & set(task.needs) for task in measured)
    (note,) = [note for note in tasks[-1].models if note.name == "theirs"]
    assert note.learns and note.about.startswith("from outside this package: theirs.py, version 3, SHA-256 ")
    what = "each fabric by itself" if one_material else "5 fabrics at once"
    assert f"; {what}, 20 steps of 1,024 queries, 2 trainings with the seeds 4 to 5" in note.about
    assert_changed(before, tasks, THEIRS_ALONE)


@pytest.mark.parametrize("named", ['model = "theirs"', 'name = "theirs"'])
def test_another_recipe_can_train_a_network(files, theirs, tmp_path, named):
    (tmp_path / "theirs.py").write_text(NETWORK)
    own = files.text
    files.text = own.replace('"tiny"', '"trains"') + HERE + "rows = 9\nseeds = 2\n"
    trainer = Path(files.write()).rename(tmp_path / "trains.toml")
    files.text = own + f'\n[[models]]\n{named}\nrecipe = "trains.toml"\n'
    recipe = load_recipe(files.write(), [theirs])
    (model,) = [one for one in recipe.models if one.options.model == "added"]
    assert (model.options.own, model.seeds, recipe.trained_by["theirs"].name) == ({"rows": 9}, 2, "trains")
    trained = ids(plan(load_recipe(trainer, [theirs])), "^train theirs")
    assert len(trained) == 2 and ids(plan(recipe), "^train theirs") == trained
    assert "code of your own is given with --add FILE.py:CLASS" in refusal(load_recipe, files.write())
    files.text = own + f'\n[[models]]\nmodel = "added"\nsource = "{theirs}"\nrecipe = "trains.toml"\n'
    assert "must be a model of the recipe trains" in refusal(load_recipe, files.write(), [theirs])


@pytest.mark.parametrize("model", ["theirs", "added", "theirs:Theirs"])
def test_a_recipe_alone_runs_no_code(files, model, theirs, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    files.text += HERE.replace("theirs", model) + f'source = "{theirs}"\n'
    monkeypatch.setattr(added, "describe", None)
    with pytest.raises(BadInput, match=r"models.3.model = .*code of your own is given with --add FILE.py:CLASS"):
        load_recipe(files.write())


@pytest.mark.parametrize(
    ("name", "add", "more", "sentence"),
    [
        ("woven", 1, "", "its name 'woven' is that of a method of the package"),
        ("added", 1, "", "its name 'added' is that of a method of the package"),
        ("theirs", 2, "", "a method 'theirs' is given twice"),
        ("truth", 1, "", "must be another name"),
        ("theirs", 1, HERE + "version = 4\n", "models.3.version = 4: the method given has version 3"),
        ("theirs", 1, HERE + "row = 4\n", "has no option 'row'; did you mean 'rows'?"),
        ("theirs", 1, HERE + "limit = 0\n", "limit = 0: Input should be greater than 0"),
        ("theirs", 1, HERE + 'memory = "all"\n', "memory = 'all': Input should be a valid number"),
        ("theirs", 1, HERE + "rows = 2026-01-01\n", "its options must be numbers, texts, lists and tables"),
        ("theirs", 1, HERE + 'name = "woven"\n', "names must differ"),
        ("theirs", 1, HERE + "[models.training]\nsteps = 5\n", "has nothing to train"),
    ],
)
def test_what_cannot_be_entered_is_refused(files, theirs, tmp_path, name, add, more, sentence):
    (tmp_path / "theirs.py").write_text(METHOD.replace('"theirs"', f'"{name}"'))
    files.text += more
    assert sentence in refusal(load_recipe, files.write(), [theirs] * add)


def test_a_metric_is_measured_of_every_model_on_every_fabric(planned, tmp_path):
    (tmp_path / "metrics.py").write_text(METRIC)
    metric = f"{tmp_path / 'metrics.py'}:largest"
    before, after = planned(), planned(metric)
    models, fabrics = ("woven", "neumip", "point_sampled"), ("denim", "own", "twill_4_4")
    new = ids(after).keys() - ids(before).keys()
    assert new == {f"bench added metric of largest, {m}, {f}" for m in models for f in fabrics}
    assert_changed(before, after, "^report")
    assert "a metric 'largest' is given twice" in refusal(planned, metric, metric)
    for key, value in (("better", "upper"), ("format", "roman")):
        (tmp_path / "metrics.py").write_text(METRIC + f"largest.{key} = {value!r}\n")
        with pytest.raises(BadInput, match=f"{key} = '{value}'"):
            planned(metric)


def test_a_method_that_fails_is_left_out_of_the_times_of_all_methods_and_ends_its_own_tasks(
    planned, theirs, tmp_path, monkeypatch
):
    def measured(task):
        names = [model.options.name for model in task.models]
        if "theirs" in names:
            raise MethodFailed("theirs", "too late")
        return [Record(method=name) for name in names]

    tasks = {task.title: task for task in planned(theirs)}
    times, own = tasks["timing of all methods"], tasks["errors of theirs, denim"]
    monkeypatch.setattr(apart, "run_apart", lambda write, *given, limits, progress: write(*given, progress))
    monkeypatch.setattr(type(times), "measure", lambda task, *rest: measured(task))
    monkeypatch.setattr(type(own), "measure", Mock(side_effect=MethodFailed("theirs", "too late")))
    (tmp_path / "records").mkdir()
    with pytest.raises(MethodFailed, match=r"^theirs: too late$"):
        own.run(tmp_path, None)
    times.run(tmp_path, None)
    *others, left_out = read_records([tmp_path / times.records])
    assert [one.method for one in others] == ["woven", "neumip", "point_sampled"]
    assert (left_out.method, left_out.metric, left_out.note) == ("theirs", "not_run", "too late")


def test_an_installed_method_enters_if_it_is_named_and_has_the_version_of_its_package(
    files, planned, tmp_path, monkeypatch
):
    assert "--add: theirs: no method of this name; none is installed" in refusal(planned, "theirs")
    site = tmp_path / "site"
    about = site / "their_distribution-1.2.dist-info"
    (site / "their_package").mkdir(parents=True)
    about.mkdir()
    (site / "their_package" / "__init__.py").write_text(METHOD)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: their-distribution\nVersion: 1.2\n")
    (about / "top_level.txt").write_text("their_package\n")
    (about / "entry_points.txt").write_text(f"[{GROUP}]\ntheirs = their_package:Theirs\n")
    monkeypatch.syspath_prepend(site)
    assert not ids(planned(), "theirs") and ids(planned("theirs"), "theirs")
    files.text += HERE
    (found,) = [model.options for model in load_recipe(files.write()).models if model.options.model == "added"]
    assert (found.source, found.distribution, found.folder) == ("their_package:Theirs", "their-distribution 1.2", "")
    before = planned()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: their-distribution\nVersion: 1.3\n")
    assert_changed(before, planned(), f"theirs|{THEIRS_ALONE}")
