import dataclasses

import pytest

from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from pipeline.fingerprint import fingerprint
from tests.jobs.identities import LEARNT, assert_changed, ids


@pytest.fixture
def tasks(files):
    return files.plan()


def titled(tasks, start):
    return {task.title: task for task in tasks if task.title.startswith(start)}


def splits(tasks, word=""):
    return {task.shard.split for task in tasks if task.stage == "generate" and word in task.title}


def test_every_row_once_in_tasks_of_shard_rows_and_the_largest_plan_is_paper_sized(tasks):
    rows = {}
    for task in tasks:
        if task.stage == "generate":
            key = task.shard.fabric.name, task.shard.split
            assert task.shard.start == rows.get(key, 0)
            rows[key] = task.shard.start + task.rows
            assert task.rows <= 1000
    counts = {"train": 2500, "validation": 100, "test": 500}
    named = {(name, split): count for name in ("denim", "own", "twill_4_4") for split, count in counts.items()}
    assert rows == named | {(f"random_00{index}", "train"): 800 for index in range(3)}
    tasks = plan(load_recipe("full_transmission"))
    assert sum(task.rows for task in tasks if task.stage == "generate") > 50_000_000


def test_plans_are_pure_in_order_of_need_with_ids_of_what_tasks_compute_and_a_file_for_each_task(files, tasks):
    assert [task.id for task in tasks] == [task.id for task in plan(load_recipe(files.write()))]
    before, written = set(), set()
    for task in tasks:
        assert before.issuperset(task.needs) and task.id not in before and written.isdisjoint(task.products)
        before.add(task.id)
        written.update(task.products)
    assert [task.id for task in tasks] == [fingerprint([task.stage, task.identity()]) for task in tasks]


def test_a_general_model_reads_no_unseen_fabric_nor_test_row_and_rows_that_nobody_reads_are_not_drawn(tasks, files):
    unseen, test = (set(ids(tasks, f"^generate.* {word} ").values()) for word in ("twill_4_4", "test"))
    for task in tasks:
        if task.stage == "train":
            assert test.isdisjoint(task.needs)
            assert unseen.isdisjoint(task.needs) == (task.title != "neumip on twill_4_4")
            assert ("twill_4_4" in task.fabrics) == (task.title == "neumip on twill_4_4")
    (woven,) = titled(tasks, "woven").values()
    assert list(woven.fabrics) == ["denim", "own", "random_000", "random_001", "random_002"]
    general = files.exchange('[[models]]\nmodel = "neumip"\n', "").plan()
    assert splits(general, "twill_4_4") == {"test"} and splits(general) == {"train", "validation", "test"}
    recipe = load_recipe(files.write())
    assert splits(plan(dataclasses.replace(recipe, models=recipe.models[1:]))) == {"test"}


EDITS = {
    "recipe name": ('name = "tiny"', 'name = "another"', "^$"),
    "source": ('source = "made up"', 'source = "measured"', "^report"),
    "order": ('seen = ["denim", "own.toml"]', 'seen = ["own.toml", "denim"]', "woven|extremes|timing|^report"),
    "training": ("steps = 10", "steps = 11", "woven|timing|^report"),
    "where and how often": ("steps = 10", 'steps = 10\ndevice = "cpu"\ncheckpoint_every = 7', "^$"),
    "network": ("hidden = 32", "hidden = 16", "woven|timing|^report"),
    "colour": ('diffuse = "#804020"', 'diffuse = "#0000cc"', "^bench.* own|^report"),
    "frames": ("frames = 4", "frames = 5", "frames|errors|noise|^report"),
    "runtimes": ("frames = 4", 'frames = 4\nruntimes = ["onnx"]', "errors of (woven|neumip)|timing|^report"),
    "repeats": ("frames = 4", "frames = 4\ntiming_repeats = 21", "timing|^report"),
    "roughness": ("roughness = 0.3", "roughness = 0.31", " own|woven|errors|noise|timing|^report"),
    "seed": ("seed = 3", "seed = 4", f"^generate|{LEARNT}"),
    "queries": ("sigma = [0.05, 8.0]", "sigma = [0.05, 9.0]", f"^generate|{LEARNT}"),
    "truth": ("relative_error = 0.05", "relative_error = 0.04", f"^generate|{LEARNT}"),
    "test rows": ("test = 500", "test = 600", "errors|noise|timing|^report"),
    "more rows": ("train = 2500", "train = 4500", LEARNT),
    "coarser truth": (*("[dataset.truth]", "[dataset.training_truth]\nrelative_error = 0.1\n[dataset.truth]"),
                      f"^generate.* train |{LEARNT}"),
}  # fmt: skip
"""Edits, and the tasks that they change."""


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_changes_the_identities_of_what_it_shapes_alone(files, tasks, edit):
    *texts, pattern = EDITS[edit]
    after = files.exchange(*texts).plan()
    assert_changed(tasks, after, pattern)
    new = {title for title in ids(after).keys() - ids(tasks).keys() if not title.startswith("report")}
    assert len(new) == {"test rows": 3, "more rows": 9}.get(edit, 0)


def test_the_silhouette_is_measured_where_the_cloth_is_curved(files, tasks):
    assert not titled(tasks, "truth edge")
    # Models that know curved cloth.
    files.exchange('model = "woven"\nhidden = 32', 'model = "curved"')
    files.exchange('model = "neumip"', 'model = "neumip"\nignore_curvature = true')
    after = files.exchange("sigma = [0.05, 8.0]", "sigma = [0.05, 8.0]\ncurvature = [0.01, 0.5]").plan()
    edges = titled(after, "truth edge of ")
    assert len(edges) == 3
    for model in ("curved", "neumip", "point_sampled"):
        (task,) = titled(after, f"errors of {model}, denim").values()
        assert edges["truth edge of denim"].id in task.needs
        assert task.edge.path.startswith("records/truth-edge-denim-")
    again = files.exchange("frames = 4", "frames = 4\nedge = { radius = 20.0 }").plan()
    assert_changed(after, again, "edge|errors|^report")


def test_settings_are_measured_on_scenes_one_by_one_and_models_of_one_kind_are_told_apart(files):
    files.exchange('model = "neumip"', 'model = "neumip"\n\n[[models]]\nmodel = "neumip"\nname = "fine"')
    page = files.plan()[-1]
    notes = {note.name: note for note in page.models}
    assert notes["fine"].kind == "neumip" and notes["fine"].about.startswith("neumip: ")
    assert {"neumip", "fine"} <= {picture.method for picture in page.pictures}
    assert len({(p.fabric, p.scene, p.method, p.setting) for p in page.pictures}) == len(page.pictures)
    # With one more number of points what was there stays, but what is about all of them.
    before = files.exchange("frames = 4", 'frames = 4\nscenes = { names = ["curtain"] }').plan()
    after = files.exchange("counts = [1, 2]", "counts = [1, 2, 128]").plan()
    assert ids(after).keys() - ids(before).keys() == {"bench scene errors of point_sampled, curtain, k = 128"}
    assert_changed(before, after, "(errors|extremes) of point_sampled(?!, curtain)|frame time|timing|^report")


def test_every_method_is_measured_on_every_named_fabric_with_the_right_model(tasks):
    measured = {task.title: task for task in tasks if task.stage == "bench"}
    woven = tuple(ids(tasks, "^train woven").values())
    for fabric in ("denim", "own", "twill_4_4"):
        for method, trainings in (("woven", woven), ("point_sampled", ())):
            assert measured[f"errors of {method}, {fabric}"].model.needs == trainings
        neumip = measured[f"errors of neumip, {fabric}"]
        assert neumip.model.needs == (ids(tasks)[f"train neumip on {fabric}"],)
        assert set(ids(tasks, f"^generate {fabric} test").values()) < set(neumip.needs)
    assert [task.title for task in tasks if task.slots == "all"] == ["latents of woven", "timing of all methods"]
    assert set(measured["timing of all methods"].needs) > set(ids(tasks, "^train").values())
    assert measured["latents of woven"].needs == measured["extremes of woven"].needs == woven
    # Of one fabric of each role.
    ends = ids(tasks, "^train neumip on (denim|twill_4_4)")
    assert measured["extremes of neumip"].needs == tuple(ends.values())
    roles = [(fabric.name, role) for fabric, role in measured["extremes of woven"].fabrics]
    assert roles == [("denim", "seen"), ("twill_4_4", "unseen")]
    assert titled(tasks, "extremes").keys() == {f"extremes of {name}" for name in ("woven", "neumip", "point_sampled")}


def test_random_unseen_fabrics_are_measured_by_general_models_alone(files, tasks):
    """One task a model, on test rows alone; all that is about the other fabrics is as it was, but for the data set."""
    unseen = '[dataset.unseen_population]\ncount = 2\nfamilies = ["irregular"]\n\n[dataset.queries]'
    planned = files.exchange("[dataset.queries]", unseen).plan()
    assert_changed(tasks, planned, "errors|noise|timing|^report")
    new = [task for task in planned if f"{task.stage} {task.title}" not in ids(tasks)]
    rows, errors = ([task for task in new if task.stage == stage] for stage in ("generate", "bench"))
    assert [(task.shard.split, task.rows) for task in rows] == [("test", 500)] * 2 and len(new) == 4
    assert [task.model.options.name for task in errors] == ["woven", "point_sampled"]
    assert all({task.id for task in rows} <= set(one.needs) for one in errors)
    names = [fabric.name for fabric, role in planned[-1].fabrics if role == "unseen"]
    assert names == ["twill_4_4", "unseen_0_irregular", "unseen_1_irregular"]
    assert [list(task.unseen) for task in planned if "timing" in task.title] == [names]


BTF = '\n[[models]]\nmodel = "unified_btf"\ntexels_per_yarn = 2\nsamples = 60\n'
BTF += BTF.replace("unified_btf", "btf_autoencoder") + "\n[bench]"


def test_extra_rows_are_tasks_that_equal_models_share(files, tasks):
    """A general model reads the samples of seen and random fabrics, one of one material those of all named ones."""
    after = files.exchange("\n[bench]", BTF).plan()
    fabrics = load_recipe(files.write()).fabrics
    extra = {task.id: task for task in after if task.stage == "generate" and "samples" in task.title}
    for fabric in fabrics:
        ends, picks = fabric.weave.repeat
        rows = sum(task.rows for task in extra.values() if task.shard.fabric.name == fabric.name)
        assert rows == 60 * 4 * ends * picks
    trainings = [task for task in after if task.stage == "train"]
    read = {task.title: {extra[need].shard.fabric.name for need in task.needs if need in extra} for task in trainings}
    assert read["unified_btf on 5 fabrics"] == {fabric.name for fabric in fabrics} - {"twill_4_4"}
    assert read["btf_autoencoder on twill_4_4"] == {"twill_4_4"} and read["woven on 5 fabrics"] == set()
    # What other models read and measure is as it was.
    assert set(ids(tasks, "^generate").values()) == set(ids(after, "^generate").values()) - extra.keys()
    assert_changed(tasks, after, "timing|^report")
