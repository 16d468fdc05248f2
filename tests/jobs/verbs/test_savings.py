import csv
import json
import math
from functools import partial

import numpy as np
import pytest

from jobs.plan.measurements.scenes import OnScene, SceneShot
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from jobs.verbs.require_recipe import write_recipe
from jobs.verbs.savings import DIFFERENCE, SceneSaving, Value, conclusion, saved
from pipeline.scenes.requirement import Requirement
from pipeline.shards.queries import QueryOptions, draw_queries
from reports.measure.pictures import write_picture
from reports.page.files import write_files
from reports.record import OF_A_PAGE, Provenance, Record, read_records, this_machine, write_records
from tests.jobs import made_up
from tests.refusals import refusal
from weaves.fabric import load_fabric

OPTIONS = {
    "seen": ["silk_charmeuse", "denim", "basket"],
    "shard_rows": 4096,
    "rows": {"train": 8192, "validation": 512, "test": 1024},
    "bench": {"scenes": {"names": ["sphere"]}},
}


def write_general(folder, **of_woven):
    """Write the general recipe, with more options of `woven`."""
    neumip = {"model": "neumip", "training": {"steps": 400, "batch": 64}}
    woven = {"model": "woven", "training": {"steps": 100, "batch": 32}} | of_woven
    return made_up.write_recipe(folder, "wide", neumip, woven, {"model": "point_sampled", "counts": [2, 4]}, **OPTIONS)


class Runs:
    """A folder of products in which both recipes have run, or seem to have."""

    def __init__(self, folder):
        self.out, self.general = folder / "out", write_general(folder)
        self.own = self.out / "recipes" / "require-sphere.toml"

    def require(self, method="neumip", setting="", effort=0.25):
        asked = {"silk_charmeuse": draw_queries(QueryOptions(sigma=(0.3, 3.0)), (5, 5), 1, 0, 500)}
        requirement = Requirement.of("sphere", 1, asked, (0.0,), ("all",))
        worn = {"silk_charmeuse": ("silk_charmeuse", load_fabric("silk_charmeuse"))}
        write_recipe(self.own, requirement, load_recipe(self.general), method, setting, "sphere", worn, effort)
        return self

    def run(self, recipe):
        """Make all shards and trainings."""
        made_up.finished(recipe, self.out, ["generate", "train"])
        return self

    def page(self, name, mse, ms, method="neumip", setting=""):
        """Write a page's Records of a method and of 2 points, whose frame takes 10 ms."""
        one = Record(method=method, setting=setting, scene="sphere", threads=1)
        values = {"mse": mse, "colour_rrmse": math.sqrt(mse), "flicker": 0.1, "fallback_share": 0.0}
        records = [one.of(metric, value, 9, low=0.8 * value, high=1.2 * value) for metric, value in values.items()]
        # Another setting of the method, which does not count.
        records += [record.model_copy(update={"setting": "k = 99", "value": 99.0}) for record in records]
        frames = {(method, setting): ms} | {("point_sampled", "k = 2"): 10.0}
        for (method, setting), value in frames.items():
            of = one.model_copy(update={"method": method, "setting": setting})
            records.append(of.of("frame_time", value, 20, low=value, high=value))
        path = self.out / "report" / name / OF_A_PAGE
        path.parent.mkdir(parents=True, exist_ok=True)
        write_records(path, records, this_machine(1))
        if name != "wide":
            page = plan(load_recipe(self.own))[-1]
            (self.out / page.products[0]).write_text("<html>")
            write_files(self.out / page.folder, [])
            made_up.finish(page, Ledger(self.out))
        return self


@pytest.fixture
def runs(tmp_path):
    return Runs(tmp_path)


def both(runs, method="neumip", setting="", **effort):
    runs.require(method, setting, **effort).run(runs.general).run(runs.own)
    return runs.page("wide", 4e-4, 40.0, method, setting).page("require-sphere", 3e-4, 20.0, method, setting)


def by_quantity(runs):
    return {row.quantity: row for row in saved("sphere", runs.out, load_recipe(runs.general))}


def test_networks_of_one_fabric_each_are_charged_for_all_fabrics_and_weigh_what_the_scene_needs(runs):
    rows = by_quantity(both(runs))
    assert (rows["queries generated"].general.value, rows["queries generated"].narrow.value) == (3 * 9728, 2048 + 1536)
    # Four shards a fabric against three, a training a fabric.
    assert (rows["generation"].general.value, rows["generation"].narrow.value) == (3 * 4 * 1.5, 3 * 1.5)
    assert (rows["training"].general.value, rows["training"].narrow.value) == (3 * 1.5, 1.5)
    learnt = rows["queries learnt from"]
    assert (learnt.general.value, learnt.narrow.value) == (3 * 400 * 64, 100 * 64) and learnt.ratio == 12.0
    assert rows["weights"].general.value == rows["weights"].narrow.value == 320
    assert rows["mse"].general == Value(4e-4, pytest.approx(3.2e-4), pytest.approx(4.8e-4))
    assert rows["frame_time"].ratio == 2.0 and rows["frame_time over 2 points"].general.value == 4.0


def test_a_model_of_many_fabrics_is_charged_for_one_of_its_trainings(runs):
    """The errors are means over all of them."""
    write_general(runs.general.parent, seeds=3)
    both(runs, "woven", effort=0.5)
    page = runs.out / "report" / "wide" / OF_A_PAGE
    trained = [
        one.model_copy(update={"value": factor * one.value, "provenance": Provenance(model="net", seed=factor)})
        for one in read_records([page])
        for factor in ((1, 2, 3) if one.metric == "mse" else (1,))
    ]
    write_records(page, trained, this_machine(1))
    rows = by_quantity(runs)
    assert (rows["queries learnt from"].general.value, rows["queries learnt from"].narrow.value) == (3200, 1600)
    assert (rows["training"].general.value, rows["training"].narrow.value) == (1.5, 1.5)
    assert rows["mse"].general.value == pytest.approx(8e-4)


def test_where_nothing_is_trained_rows_of_the_test_are_saved_and_the_command_prints_all(runs, call):
    rows = by_quantity(both(runs, "point_sampled", "k = 2"))
    assert rows["queries generated"].ratio == 3.0 and math.isnan(rows["queries learnt from"].ratio)
    assert rows["frame_time over 2 points"].general.value == 1.0
    assert "3.0 times fewer queries to generate; MSE 0.0003 in place of 0.0004." in conclusion([*rows.values()])
    code, text, _ = call("savings", both(runs).general, "sphere", "--out", runs.out)
    assert code == 0 and "queries generated 29,184 3.58e+03 8.14" in text
    assert "sphere, neumip: 8.1 times fewer queries to generate, 12.0 times fewer to learn from" in text
    with (runs.out / "report" / "savings.csv").open(newline="") as file:
        rows = {row["quantity"]: row for row in csv.DictReader(file)}
    assert float(rows["queries learnt from"]["ratio"]) == 12.0 and rows["training"]["unit"] == "s"
    assert (float(rows["mse"]["general_high"]), float(rows["mse"]["own_low"])) == pytest.approx((4.8e-4, 2.4e-4))


@pytest.mark.parametrize(
    ("interval", "words"),
    [((-2, -1), ", paired: less"), ((1, 2), ", paired: more"), ((-1, 1), ", paired: no difference shown"), ((), "")],
)
def test_the_verdict_says_whether_the_error_differs_and_whether_little_is_saved(interval, words):
    quantities = ("queries generated", "queries learnt from", "mse")
    rows = [SceneSaving("s", "m", name, "1", Value(2.0), Value(1.0)) for name in quantities]
    if interval:
        rows.append(SceneSaving("s", "m", DIFFERENCE, "1", Value(0.0), Value(0.0, *interval)))
    assert conclusion(rows).endswith(f"; MSE 1 in place of 2{words}; less than 3 times.")


def test_pictures_of_both_recipes_are_paired_where_they_are_there(runs):
    """Two pictures of four pixels with MSE .04 and .01 against a black truth, and its frames."""
    both(runs)
    for recipe, value in ((runs.general, 0.2), (runs.own, 0.1)):
        tasks = [task for task in plan(load_recipe(recipe)) if isinstance(task, SceneShot | OnScene)]
        for task in tasks:
            if isinstance(task, SceneShot):
                write_frames(runs.out / task.products[0], load_fabric("silk_charmeuse"))
            elif task.model.options.name == "neumip":
                write_picture(runs.out / task.picture(""), np.full((8, 8, 3), value), np.ones((8, 8), np.bool_), {})
            else:
                continue
            for path in map(runs.out.joinpath, task.products):
                path.touch()
            made_up.finish(task, Ledger(runs.out))
    row = by_quantity(runs)[DIFFERENCE]
    assert row.narrow == pytest.approx((-0.03, -0.03, -0.03), rel=1e-5) and math.isnan(row.ratio)
    for path in runs.out.glob("records/scene-truth-sphere-*.npz"):  # of the right size, with other bytes
        path.write_bytes(b"\0" * path.stat().st_size)
    assert DIFFERENCE not in by_quantity(runs)


def write_frames(path, fabric):
    """Write one frame of 8 x 8 pixels, each with one query whose answer is 0."""
    queries = draw_queries(QueryOptions(), (5, 5), 1, 0, 64)
    columns = queries._asdict() | {"frame": np.zeros(64, np.int64), "pixel": np.arange(64)}
    columns |= {"weight": np.ones((64, 3), np.float32)}
    columns |= dict.fromkeys(("mean", "standard_error", "fallback_values"), np.zeros((64, 4), np.float32))
    columns |= {f"rim.{name}": column[:0] for name, column in queries._asdict().items()}
    columns |= {"rim.coverage": np.zeros(0, np.float32)}
    about = {"name": "sphere", "cloths": {"a": fabric.model_dump(mode="json")}}
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {f"a.{name}": column for name, column in columns.items()}
    np.savez(path, about=np.array(json.dumps(about)), base=np.zeros((1, 8, 8, 3), np.float32), **arrays)


def test_what_is_missing_is_one_sentence_that_says_what_to_run(runs):
    refused = partial(refusal, by_quantity, runs)
    assert "twillight require sphere" in refused()
    runs.require()
    assert "15 of 15 tasks" in refused() and "twillight run wide" in refused()
    runs.run(runs.general)
    assert "no page" in refused() and "twillight run wide" in refused()
    runs.page("wide", 1e-4, 1.0)
    assert f"twillight run {runs.own}" in refused() and "4 of 4 tasks" in refused()
    runs.run(runs.own).page("require-sphere", 1e-4, 1.0, "woven")
    assert "no mse of neumip there" in refused()
    runs.page("require-sphere", 1e-4, 1.0)
    runs.own.write_text(runs.own.read_text() + "seed = 7\n")
    assert "its page is older than the recipe" in refused()
    runs.own.write_text(runs.own.read_text().replace('name = "neumip"', 'name = "other"'))
    assert "no such method" in refused()
