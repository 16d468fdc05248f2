import dataclasses

import pytest

from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe


def ids(tasks, stage, word=""):
    return [task.id for task in tasks if task.stage == stage and word in task.title]


@pytest.fixture
def tasks(files):
    return files.plan()


def edited(files, old, new):
    return files.exchange(old, new).plan()


def test_every_row_once_in_tasks_of_shard_rows(tasks):
    rows = {}
    for task in tasks:
        if task.stage == "generate":
            key = task.shard.fabric.name, task.shard.split
            assert task.shard.start == rows.get(key, 0)
            rows[key] = task.shard.start + task.rows
            assert task.rows <= 1000
    named = {(name, split): count for name in ("denim", "own", "twill_4_4") for split, count in SPLITS.items()}
    assert rows == named | {(f"random_00{index}", "train"): 800 for index in range(3)}


SPLITS = {"train": 2500, "validation": 100, "test": 500}


def test_plans_are_pure_and_in_order_of_need(files, tasks):
    assert [task.id for task in tasks] == [task.id for task in plan(load_recipe(files.write()))]
    assert len({task.id for task in tasks}) == len(tasks)
    before = set()
    for task in tasks:
        assert before.issuperset(task.needs)
        before.add(task.id)


def test_a_general_model_never_reads_the_unseen_fabric_nor_any_test_row(tasks):
    unseen, test = set(ids(tasks, "generate", "twill_4_4")), set(ids(tasks, "generate", " test "))
    for task in tasks:
        if task.stage == "train":
            assert test.isdisjoint(task.needs)
            assert unseen.isdisjoint(task.needs) == (task.title != "neumip on twill_4_4")
            assert ("twill_4_4" in task.fabrics) == (task.title == "neumip on twill_4_4")
    woven = next(task for task in tasks if task.title.startswith("woven"))
    assert list(woven.fabrics) == ["denim", "own", "random_000", "random_001", "random_002"]


def test_without_a_model_of_one_material_the_unseen_fabric_has_no_training_rows(files):
    tasks = edited(files, '[[models]]\nmodel = "neumip"\n', "")
    assert {task.shard.split for task in tasks if task.stage == "generate" and "twill_4_4" in task.title} == {"test"}


EDITS = {
    "recipe name": ('name = "tiny"', 'name = "another"'),
    "source": ('source = "made up"', 'source = "measured"'),
    "order": ('seen = ["denim", "own.toml"]', 'seen = ["own.toml", "denim"]'),
    "training": ("steps = 10", "steps = 11"),
    "where and how often": ("steps = 10", 'steps = 10\ndevice = "cpu"\ncheckpoint_every = 7'),
    "network": ("hidden = 32", "hidden = 16"),
    "colour": ('diffuse = "#804020"', 'diffuse = "#0000ff"'),
    "frames": ("frames = 4", "frames = 5"),
    "runtimes": ("frames = 4", 'frames = 4\nruntimes = ["onnx", "eager-bf16"]'),
    "roughness": ("roughness = 0.3", "roughness = 0.31"),
    "seed": ("seed = 3", "seed = 4"),
    "queries": ("sigma = [0.05, 8.0]", "sigma = [0.05, 9.0]"),
    "truth": ("relative_error = 0.05", "relative_error = 0.04"),
    "test rows": ("test = 500", "test = 600"),
    "coarser truth": (
        '[[models]]\nmodel = "woven"',
        '[dataset.training_truth]\nrelative_error = 0.1\n[[models]]\nmodel = "woven"',
    ),
}

NO_ROWS = ["recipe name", "source", "order", "training", "network", "colour", "frames"]

KEPT = [
    *((edit, "generate", "") for edit in NO_ROWS),
    *(("roughness", "generate", fabric) for fabric in ("denim", "random", "twill_4_4")),
    ("roughness", "train", "neumip on denim"),
    *(("coarser truth", "generate", split) for split in (" validation ", " test ")),
    *((edit, "train", "") for edit in ("where and how often", "colour", "runtimes")),
    *(("colour", "bench", fabric) for fabric in ("denim", "twill_4_4")),
    *((edit, "bench", f"truth {image} of ") for edit in ("network", "seed") for image in ("picture", "frames")),
    ("frames", "bench", "truth picture of denim, sphere"),
    # Their pairs are presets: no row and no fabric of the recipe enters but through the network and the queries.
    *((edit, "bench", kind) for edit in ("frames", "test rows") for kind in ("latents", "extremes")),
]
"""Edits, and the tasks of a stage that they do not change."""

CHANGED = [
    *((edit, "generate", "") for edit in ("seed", "queries", "truth")),
    ("roughness", "generate", "own"),
    *(("roughness", "train", model) for model in ("neumip on own", "woven")),
    ("coarser truth", "generate", " train "),
    ("network", "train", "woven"),
    ("colour", "bench", "own"),
    ("queries", "bench", "latents"),
    *(("runtimes", "bench", title) for title in ("errors of woven, denim", "timing of all methods")),
]
"""Edits, and the tasks of a stage all of which they change."""


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_changes_the_identities_of_what_it_shapes_alone(files, tasks, edit):
    after = edited(files, *EDITS[edit])
    for _, *some in (case for case in KEPT if case[0] == edit):
        assert set(ids(after, *some)) == set(ids(tasks, *some)) != set(), some
    for _, *some in (case for case in CHANGED if case[0] == edit):
        assert ids(tasks, *some) and set(ids(after, *some)).isdisjoint(ids(tasks, *some)), some


def test_more_rows_keep_the_shards_that_are_full(files, tasks):
    after = edited(files, "train = 2500", "train = 4500")
    before, later = (set(ids(plan_, "generate", "denim train")) for plan_ in (tasks, after))
    assert len(before & later) == 2 and len(later) == 5


def test_the_silhouette_is_measured_where_the_cloth_is_curved(files, tasks):
    assert not ids(tasks, "bench", "truth edge of ")
    # Models that know curved cloth.
    files.exchange('model = "woven"\nhidden = 32', 'model = "curved"')
    files.exchange('model = "neumip"', 'model = "neumip"\nignore_curvature = true')
    after = edited(files, "sigma = [0.05, 8.0]", "sigma = [0.05, 8.0]\ncurvature = [0.01, 0.5]")
    edges = ids(after, "bench", "truth edge of ")
    assert len(edges) == 3
    for task in after:
        if task.stage == "bench" and task.kind == "errors" and task.fabric.name == "denim":
            assert edges[0] in task.needs and task.edge.path.startswith("records/truth-edge-denim-")
    again = edited(files, "frames = 4", "frames = 4\nedge = { radius = 20.0 }")
    assert set(ids(again, "bench", "truth edge of ")).isdisjoint(edges)
    assert ids(again, "bench", ", sphere") == ids(after, "bench", ", sphere")


def test_models_of_one_kind_are_told_apart_on_the_page(files):
    tasks = edited(files, 'model = "neumip"', 'model = "neumip"\n\n[[models]]\nmodel = "neumip"\nname = "fine"')
    page = tasks[-1]
    notes = {note.name: note for note in page.models}
    assert notes["fine"].kind == "neumip" and notes["fine"].about.startswith("neumip: ")
    assert {"neumip", "fine"} <= {picture.method for picture in page.pictures}
    assert len({(p.fabric, p.scene, p.method, p.setting) for p in page.pictures}) == len(page.pictures)


def test_truth_of_pictures_is_shared_by_all_models(tasks):
    assert [len(ids(tasks, "bench", f"truth {image} of ")) for image in ("picture", "frames")] == [3 * 2, 3]


def test_every_method_is_measured_on_every_named_fabric_with_the_right_model(tasks):
    measured = {task.title: task for task in tasks if task.stage == "bench"}
    for fabric in ("denim", "own", "twill_4_4"):
        for method, trainings in (("woven", ids(tasks, "train", "woven")), ("point_sampled", [])):
            assert measured[f"errors of {method}, {fabric}"].model.needs == tuple(trainings)
        neumip = measured[f"errors of neumip, {fabric}"]
        assert list(neumip.model.needs) == ids(tasks, "train", f"neumip on {fabric}")
        assert set(ids(tasks, "generate", f"{fabric} test")) < set(neumip.needs)
    assert [task.title for task in tasks if task.slots == "all"] == ["latents of woven", "timing of all methods"]
    assert set(measured["timing of all methods"].needs) > set(ids(tasks, "train"))


def test_random_unseen_fabrics_are_measured_by_general_models_alone(files, tasks):
    """One task a model, on test rows alone; all that is about the other fabrics is as it was, but for the data set."""
    unseen = '[dataset.unseen_population]\ncount = 2\nfamilies = ["irregular"]\n\n[dataset.queries]'
    planned = edited(files, "[dataset.queries]", unseen)
    added = [task for task in planned if getattr(task, "kind", "") == "errors on random fabrics"]
    assert [task.model.options.name for task in added] == ["woven", "point_sampled"]
    rows = [task for task in planned if getattr(task, "role", "") == "unseen_population"]
    assert {task.shard.split for task in rows} == {"test"} and {task.rows for task in rows} == {500}
    assert all({task.id for task in rows} <= set(one.needs) for one in added)
    for stage in ("generate", "train"):
        before, after = ({task.id for task in some if task.stage == stage} for some in (tasks, planned))
        assert after - before == ({task.id for task in rows} if stage == "generate" else set()) and before <= after
    (page,) = (task for task in planned if task.stage == "report")
    assert [fabric.name for fabric, role in page.fabrics if role == "unseen"][1:] == [
        "unseen_0_irregular",
        "unseen_1_irregular",
    ]


def test_what_lies_between_fabrics_needs_the_training_alone(tasks):
    (task,) = [task for task in tasks if task.title.startswith("latents")]
    assert task.title == "latents of woven" and list(task.needs) == ids(tasks, "train", "woven")


def test_extremes_need_the_trainings_alone_and_know_one_fabric_of_each_role(tasks):
    found = {task.title: task for task in tasks if task.title.startswith("extremes")}
    assert set(found) == {"extremes of woven", "extremes of neumip", "extremes of point_sampled"}
    assert list(found["extremes of woven"].needs) == ids(tasks, "train", "woven")
    ends = ids(tasks, "train", "neumip on denim") + ids(tasks, "train", "neumip on twill_4_4")
    assert list(found["extremes of neumip"].needs) == ends
    assert [(fabric.name, role) for fabric, role in found["extremes of woven"].fabrics] == [
        ("denim", "seen"),
        ("twill_4_4", "unseen"),
    ]


def test_wished_errors_touch_methods_that_estimate_errors_alone(files):
    plain = edited(files, "[bench]", '[[models]]\nmodel = "selvage"\n\n[bench]')
    wished = edited(files, "frames = 4", "frames = 4\nwished_errors = [0.05]")
    assert ids(wished, "train") == ids(plain, "train")
    for title in ("errors of woven, denim", "errors of neumip, denim"):
        assert ids(wished, "bench", title) == ids(plain, "bench", title) != []
    for title in ("errors of selvage, denim", "timing of all methods"):
        assert set(ids(wished, "bench", title)).isdisjoint(ids(plain, "bench", title))


def test_timing_options_touch_the_timing_and_the_page_alone(files, tasks):
    after = edited(files, "frames = 4", "frames = 4\ntiming_repeats = 21")
    changed = {task.id for task in after} ^ {task.id for task in tasks}
    touched = [key for one in (tasks, after) for key in ids(one, "bench", "timing") + ids(one, "report")]
    assert changed == set(touched)


def test_no_two_tasks_write_one_file(tasks):
    products = [path for task in tasks for path in task.products]
    assert len(set(products)) == len(products)


def test_the_full_plan_is_paper_sized():
    tasks = plan(load_recipe("full"))
    assert sum(task.rows for task in tasks if task.stage == "generate") > 50_000_000


def test_rows_that_nobody_learns_from_are_not_drawn():
    quick = load_recipe("quick")
    idle = dataclasses.replace(quick, models=tuple(m for m in quick.models if not m.learns))
    drawn = {task.shard.split for task in plan(idle) if task.stage == "generate"}
    assert drawn == {"test"}
    every = {task.shard.split for task in plan(quick) if task.stage == "generate"}
    assert every == {"train", "validation", "test"}


def test_settings_are_measured_on_scenes_one_by_one():
    """Of smoke, with one more number of points: what was there stays, but the timing of all side by side."""
    smoke = load_recipe("smoke")
    (points,) = (model for model in smoke.models if model.options.name == "point_sampled")
    more = points.options.model_copy(update={"counts": [*points.options.counts, 128]})
    models = [m.model_copy(update={"options": more}) if m is points else m for m in smoke.models]
    before, after = plan(smoke), plan(dataclasses.replace(smoke, models=tuple(models)))
    title = "scene errors of point_sampled, curtain"
    assert len(ids(before, "bench", title)) == len(ids(after, "bench", title)) - 1
    assert set(ids(before, "bench", title)) < set(ids(after, "bench", title))
    assert ids(after, "bench", f"{title}, k = 128")


BTF = """
[[models]]
model = "unified_btf"
texels_per_yarn = 2
samples = 60

[[models]]
model = "btf_autoencoder"
texels_per_yarn = 2
samples = 60
"""


def test_extra_rows_are_tasks_that_equal_models_share(files, tasks):
    """A general model reads the samples of seen and random fabrics, one of one material those of all named ones."""
    files.text = files.text.replace("\n[bench]", BTF + "\n[bench]")
    recipe = load_recipe(files.write())
    after = plan(recipe)
    extra = {task.id: task for task in after if task.stage == "generate" and "samples" in task.title}
    names = {task.shard.fabric.name for task in extra.values()}
    assert names == {fabric.name for fabric in recipe.fabrics}
    for fabric in recipe.fabrics:
        ends, picks = fabric.weave.repeat
        rows = sum(task.rows for task in extra.values() if task.shard.fabric.name == fabric.name)
        assert rows == 60 * 4 * ends * picks
    trainings = [task for task in after if task.stage == "train"]
    read = {task.title: {extra[need].shard.fabric.name for need in task.needs if need in extra} for task in trainings}
    assert read["unified_btf on 5 fabrics"] == names - {"twill_4_4"}
    assert read["btf_autoencoder on twill_4_4"] == {"twill_4_4"}
    assert read["woven on 5 fabrics"] == set()
    # What other models read and measure is as it was.
    assert set(ids(tasks, "generate")) == set(ids(after, "generate")) - extra.keys()
    assert {task.id for task in tasks if task.stage == "bench" and "timing" not in task.title} <= {t.id for t in after}
