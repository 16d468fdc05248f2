import dataclasses
import os

import pytest

from jobs.recipe.load import load_recipe
from jobs.verbs.require_recipe import SAMPLED, alone, effort_of, savings, write_recipe
from pipeline.models.curved import CurvedOptions
from pipeline.scenes.requirement import Requirement
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.options import TruthOptions
from tests.jobs.recipe.test_added import METHOD
from tests.refusals import refusal
from weaves.errors import BadInput
from weaves.fabric import load_fabric

QUICK = load_recipe("quick")
FLAT = QueryOptions(sigma=(0.3, 3.0), max_angle=70.0)


def require(options=FLAT, names=("denim",), scene="sphere"):
    asked = {name: draw_queries(options, (4, 4), 1, 0, 2000) for name in names}
    return Requirement.of(scene, 1, asked, (0.0, 1.0), ("small", "large"))


def narrowed(path, general=QUICK, method="woven", setting="", requirement=None, scene="sphere", worn=None, **more):
    requirement = requirement or require()
    worn = worn or {name: (name, load_fabric(name)) for name in requirement.fabrics}
    write_recipe(path, requirement, general, method, setting, scene, worn, **more)
    return load_recipe(path, more.get("add", ()))


def test_truth_and_measurements_are_those_of_the_general_recipe(tmp_path):
    # A live page of a fabric that the scene does not wear is left out.
    live = QUICK.bench.live.model_copy(update={"fabrics": ("polyester_lining", "denim")})
    general = dataclasses.replace(QUICK, bench=QUICK.bench.model_copy(update={"live": live}))
    own = narrowed(tmp_path / "r.toml", general)
    assert own.bench.live.fabrics == ("denim",)
    assert own.dataset.truth == QUICK.dataset.truth and own.dataset.training_truth == QUICK.dataset.training_truth
    # Where the general recipe renders frames, so does this one: the same frames, by the same truth.
    assert own.bench.scenes.model_copy(update={"names": ()}) == QUICK.bench.scenes.model_copy(update={"names": ()})
    assert own.bench.scenes.names == ("sphere",) and not own.bench.bounds
    assert [model.options.name for model in own.models] == ["woven", "point_sampled"]
    assert own.models[1].options.counts == [2] and [fabric.name for fabric in own.fabrics] == ["denim"]


MACRO = {"frame": "macro", "parallax": False, "walls": "left_out"}


def _with_macro(options, **more):
    """Return measurements whose truth has cosines to the macro normal."""
    truths = {k: getattr(options, k).model_copy(update=MACRO) for k in ("truth", "frame_truth")}
    return options.model_copy(update=truths | more)


def test_physics_and_stated_errors_of_a_truth_are_kept(tmp_path):
    truth = TruthOptions(estimator="owen", relative_error=0.01, max_count=8192, **MACRO)
    training = TruthOptions(relative_error=0.3, **MACRO)
    dataset = QUICK.dataset.model_copy(update={"truth": truth, "training_truth": training})
    bench = _with_macro(QUICK.bench, scenes=_with_macro(QUICK.bench.scenes))
    general = dataclasses.replace(QUICK, dataset=dataset, models=QUICK.models[1:2], bench=bench)
    own = narrowed(tmp_path / "r.toml", general, "neumip")
    # Points know no other frame, and the general recipe has none.
    assert [model.options.name for model in own.models] == ["neumip"]
    assert (own.dataset.truth, own.dataset.training_truth) == (truth, training)


@pytest.mark.parametrize("sigma", [(0.3, 3.0), (0.002, 0.01)])
def test_a_table_that_cannot_answer_makes_way_for_sampling_at_a_stated_error(tmp_path, sigma):
    curved = load_recipe("curved")
    table = TruthOptions(estimator="node_table")
    general = dataclasses.replace(curved, dataset=curved.dataset.model_copy(update={"training_truth": table}))
    bent = require(QueryOptions(sigma=sigma, curvature=(0.01, 0.1)))
    own = narrowed(tmp_path / "r.toml", general, "curved", requirement=bent)
    assert own.dataset.queries.curvature[1] > 0 and own.dataset.training_truth == SAMPLED


def test_the_training_is_cut_by_the_effort_with_its_average_and_what_is_saved_is_counted(tmp_path):
    recipe = narrowed(tmp_path / "r.toml", effort=0.25)
    assert (recipe.dataset.rows.train, recipe.dataset.rows.population) == (16384, 0)
    own, general = recipe.models[0].training, QUICK.models[0].training
    assert own.steps == general.steps // 4 and (own.batch, own.learning_rate) == (general.batch, general.learning_rate)
    # After a quarter of the steps, the average forgets four times as fast.
    assert own.average**own.steps == pytest.approx(general.average**general.steps, rel=1e-2)
    # No more rows than the general recipe has, whatever the effort.
    assert narrowed(tmp_path / "r.toml", effort=3.0).dataset.rows.train == 65536
    assert effort_of(narrowed(tmp_path / "r.toml", method="neumip", effort=0.5)) == (32768 + 2048 + 4096, 700 * 512)
    # By itself neumip learns from the seven named fabrics; the population is drawn for the general recipe all the same.
    assert effort_of(alone(QUICK, {"neumip"})) == (7 * (65536 + 2048 + 4096) + 20 * 16384, 7 * 1400 * 512)
    said = savings(tmp_path / "r.toml", QUICK)
    assert "38,912 rows to generate in place of 829,440 (21.3 times fewer)" in said
    assert "358,400 queries to learn from in place of 5,017,600 (14.0 times)" in said


@pytest.mark.parametrize(("method", "parameter", "k"), [("point_sampled", "counts", 16), ("soft_nodes", "levels", 2)])
def test_one_setting_is_enough(tmp_path, method, parameter, k):
    own = narrowed(tmp_path / "r.toml", method=method, setting=f"k = {k}")
    assert getattr(own.models[0].options, parameter) == [k]
    assert len(own.models) == (1 if method == "point_sampled" else 2)
    assert "nothing to train" in savings(tmp_path / "r.toml", QUICK)


def test_a_model_can_be_made_smaller_and_has_its_other_options(tmp_path):
    own = narrowed(tmp_path / "r.toml", options={"hidden": 64}).models[0].options
    assert own == QUICK.models[0].options.model_copy(update={"hidden": 64})
    with pytest.raises(BadInput, match=r"--set: hiden = 64: unknown key; did you mean 'hidden'"):
        narrowed(tmp_path / "other.toml", options={"hiden": 64})
    assert not (tmp_path / "other.toml").exists()
    # But for the largest curvature, where the scene's is beyond it: the rows would be refused in training.
    curved = load_recipe("curved")
    own = narrowed(tmp_path / "r.toml", curved, "curved_grazing", requirement=require(curved.dataset.queries))
    bent = own.dataset.queries.curvature[1]
    assert bent > CurvedOptions().largest_curvature
    assert own.models[0].options == CurvedOptions(name="curved_grazing", silhouette="grazing", largest_curvature=bent)


def test_scenes_and_fabrics_by_path_are_found_from_anywhere(tmp_path, monkeypatch, files):
    """Named from one folder, written to another, read from a third."""
    files.write()
    path = tmp_path / "out" / "recipes" / "r.toml"
    (tmp_path / "attic.xml").write_text("<scene version='3.0.0'/>")
    (tmp_path / "attic.toml").write_text('name = "attic"\nsource = "attic.xml"\n[cloths.own]\nfabric = "own.toml"\n')
    monkeypatch.chdir(tmp_path)
    requirement = require(names=("own", "denim"), scene="attic")
    worn = {"own": ("own.toml", load_fabric("own.toml")), "denim": ("denim", load_fabric("denim"))}
    narrowed(path, requirement=requirement, scene="attic.toml", worn=worn)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for named in (path, os.path.relpath(path)):
        own = load_recipe(named)
        assert [fabric.name for fabric in own.seen] == ["own", "denim"]
        assert own.bench.scenes.names == (str(tmp_path / "attic.toml"),)
    assert str(tmp_path) not in path.read_text()


def test_a_method_from_outside_keeps_its_name_and_its_options(tmp_path):
    code = tmp_path / "theirs.py"
    code.write_text(METHOD, encoding="utf-8")
    add = [f"{code}:Theirs"]
    general = load_recipe("quick", add)
    first = narrowed(tmp_path / "r.toml", general, "theirs", options={"rows": 5}, add=add).models[0].options
    assert "code of your own is given with --add" in refusal(load_recipe, tmp_path / "r.toml")
    assert (first.model, first.name, first.own, first.source) == ("added", "theirs", {"rows": 5}, f"{code}:Theirs")
    assert code.name not in (tmp_path / "r.toml").read_text(encoding="utf-8")
