from functools import partial

import pytest

from jobs.recipe.load import load_recipe
from jobs.verbs import require as verb
from reports.measure.by_size import EDGES
from reports.record import OF_A_PAGE, Record, read_records, this_machine, write_records
from tests.jobs import made_up

MODELS = {"model": "woven", "training": {"steps": 400}}, "neumip", {"model": "point_sampled", "counts": [2, 16]}
OPTIONS = {
    "seen": ["denim", "silk_charmeuse", "polyester_lining", "basket"],
    "rows": {"train": 8192},
    "queries": {"sigma": [0.05, 8.0], "max_angle": 80.0},
    "training_truth": {"relative_error": 0.3},
    "bench": {"scenes": {"names": ["plane"], "size": [24, 18]}},
}

ERRORS = {
    ("woven", ""): (0.1, 900.0),
    ("point_sampled", "k = 2"): (0.6, 100.0),
    ("point_sampled", "k = 16"): (0.2, 800.0),
}


@pytest.fixture
def require(tmp_path, call, refused):
    """Call the command in a folder that holds a page with errors and times by size; `refused` returns a sentence."""
    pytest.importorskip("mitsuba")
    made_up.write_recipe(tmp_path, "wide", *MODELS, **OPTIONS)
    records = []
    for (method, setting), (error, ns) in ERRORS.items():
        one = Record(method=method, setting=setting)
        for metric, value in (("size_colour", error), ("size_time", ns)):
            records.append(one.of(metric, value, 9, curve=tuple((low, value) for low in EDGES[:-1])))
    page = tmp_path / "out" / "report" / "wide" / OF_A_PAGE
    page.parent.mkdir(parents=True)
    write_records(page, records, this_machine(1))
    require = partial(call, "require", "plane", "--recipe", "wide.toml", "--frames", "1")
    require.refused = partial(refused, *require.args)
    return require


def test_a_wish_for_a_method_or_an_error_is_met_and_the_recipe_loads_from_elsewhere(require, tmp_path, monkeypatch):
    code, text, _ = require("--method", "woven", "--effort", ".5", "--set", "hidden=16")
    assert code == 0 and "(from its footprints)" in text
    own = load_recipe(tmp_path / "out" / "recipes" / "require-plane.toml")
    assert own.models[0].options.model == "woven" and own.models[0].options.hidden == 16
    assert own.models[0].training.steps == 200 and own.dataset.rows.train == 4096
    code, text, _ = require("--error", ".3")
    assert code == 0 and "denim 100 %" in text and "light from behind 0.0 %" in text
    # 16 points err .2 and take less time than woven does.
    monkeypatch.chdir("/")
    own = load_recipe(tmp_path / "out" / "recipes" / "require-plane.toml")
    assert own.models[0].options.counts == [16] and [fabric.name for fabric in own.fabrics] == ["denim"]
    assert own.bench.scenes.names == ("plane",) and own.bench.scenes.size == (24, 18)


def test_what_lies_beyond_the_general_domain_counts_as_the_fallbacks(require, monkeypatch):
    """The plane reaches the horizon: of a model trained up to 80 degrees, what is seen steeper is not its own."""
    seen, share = {}, verb._fallback_share
    monkeypatch.setattr(
        verb, "_fallback_share", lambda model, *rest: seen.setdefault(model.options.name, share(model, *rest))
    )
    assert require()[0] == 0
    assert 0.1 < seen["woven"] < 0.9 and seen["woven"] == seen["neumip"] and seen["point_sampled"] == 0.0


def test_a_wish_that_nothing_meets_names_the_nearest_points_and_the_general_recipe_may_run_first(require, monkeypatch):
    told = require.refused("--error", ".01", "--time", ".001")
    assert "no method meets them" in told and "point_sampled k = 2" in told
    told = require.refused("--method", "woven", "--error", ".01")
    assert "woven: " in told and "point_sampled" not in told
    ran = []
    monkeypatch.setattr(verb, "work", lambda recipe, stages, *_: ran.append((recipe, stages)))
    assert require("--run")[0] == 0 and ran == [("wide.toml", verb.STAGES)]


def test_a_method_that_was_not_measured_or_that_only_an_old_page_has_is_refused(require, tmp_path):
    assert "--method = 'neumip': it was not measured" in require.refused("--method", "neumip")
    path = tmp_path / "out" / "report" / "wide" / OF_A_PAGE
    best = Record(method="sums", scene="plane", threads=1)
    numbers = {"mse": 1e-6, "colour_rrmse": 0.001, "fallback_share": 0.0, "frame_time": 1e-6}
    records = [best.of(metric, value, 9) for metric, value in numbers.items()]
    write_records(path, [*read_records([path]), *records], this_machine(1))
    assert "the page of wide: method = 'sums'" in require.refused() and require("--method", "point_sampled")[0] == 0
    path.unlink()
    assert "no page of the recipe wide with Records: `twillight run wide.toml` must run first" in require.refused()
