import pytest

from jobs.plan.measurements.fabrics import AtExtremes, ErrorsBySize, Latents, OnFabric, TimeOfMethods
from jobs.plan.measurements.scenes import FrameTime, OnScene
from jobs.plan.training import Training
from tests.jobs.identities import assert_changed

SEEDS = ('model = "woven"\nhidden = 32', 'model = "woven"\nhidden = 32\nseeds = 3')


@pytest.fixture
def one(files):
    """The tasks of the recipe with one training of each model."""
    files.exchange("frames = 4", 'frames = 4\nruntimes = ["onnx"]\n[bench.scenes]\nnames = ["curtain", "drape"]')
    return files.plan()


@pytest.fixture
def three(one, files):
    """The tasks of the recipe with three trainings of `woven`."""
    return files.exchange(*SEEDS).plan()


def of(tasks, kind, name="woven"):
    """Return the tasks of a kind that are about one model, by their seeds."""
    found = {}
    for task in tasks:
        if isinstance(task, kind):
            options = task.options if kind is Training else task.model.options
            seed = task.training.seed if kind is Training else task.model.seed
            if options.name == name:
                found.setdefault(seed, []).append(task)
    return found


def test_more_seeds_add_trainings_change_none_and_are_named(one, three, files):
    before, after = of(one, Training), of(three, Training)
    assert list(before) == [0] and list(after) == [0, 1, 2] and len({task.id for (task,) in after.values()}) == 3
    assert {task.training.model_copy(update={"seed": 0}) for (task,) in after.values()} == {before[0][0].training}
    assert after[2][0].title == "woven on 5 fabrics, seed 2"
    assert_changed(one, three, "^report")
    assert list(of(files.exchange("steps = 10", "steps = 10\nseed = 5").plan(), Training)) == [5, 6, 7]
    (note,) = [note for note in three[-1].models if note.name == "woven"]
    assert "3 trainings with the seeds 0 to 2" in note.about
    trained = {seed: task.id for seed, (task,) in of(three, Training).items()}
    assert note.fingerprint == trained[0] and not any("trainings with" in note.about for note in one[-1].models)


def test_each_training_of_one_material_has_every_seed(one, files):
    tasks = files.exchange('model = "neumip"', 'model = "neumip"\nseeds = 2').plan()
    found = of(tasks, Training, "neumip")
    groups = [("denim",), ("own",), ("twill_4_4",)]
    assert {seed: [task.fabrics for task in same] for seed, same in found.items()} == {0: groups, 1: groups}
    (by_size,) = of(tasks, ErrorsBySize, "neumip")[1]
    assert [made.task for made in by_size.model.networks] == [task.id for task in found[1]]


@pytest.mark.parametrize("kind", [OnFabric, OnScene, AtExtremes])
def test_errors_are_measured_of_every_training(one, three, kind):
    before, after = of(one, kind), of(three, kind)
    assert list(after) == [0, 1, 2] and {len(same) for same in after.values()} == {len(before[0])}
    networks = {seed: task.id for seed, (task,) in of(three, Training).items()}
    for seed, same in after.items():
        assert all(networks[seed] in task.needs for task in same)
    assert len({task.title for same in after.values() for task in same}) == 3 * len(before[0])


def test_times_latents_pictures_and_runtimes_are_of_the_first_training_and_bounds_of_every_one(one, three, files):
    """And errors by size, which are measured with its times."""
    assert not of(one, ErrorsBySize) and list(of(three, ErrorsBySize)) == [1, 2]
    for kind in (TimeOfMethods, FrameTime, Latents):
        assert [task.id for task in one if isinstance(task, kind)] == [t.id for t in three if isinstance(t, kind)]
    assert one[-1].pictures == three[-1].pictures
    for kind in (OnFabric, OnScene):
        assert {bool(task.pictures) for task in of(three, kind)[0]} == {True}
        assert {bool(task.pictures) for seed in (1, 2) for task in of(three, kind)[seed]} == {False}
    assert {seed: same[0].ways.runtimes for seed, same in of(three, OnFabric).items()} == {0: ("onnx",), 1: (), 2: ()}
    tasks = files.exchange("frames = 4", "frames = 4\nbounds = true").plan()
    bounds = {seed: {task.ways.bounds for task in same} for seed, same in of(tasks, OnFabric).items()}
    assert bounds == {0: {True}, 1: {True}, 2: {True}}
