import numpy as np
import pytest

from pipeline.truth.options import TruthOptions
from reports.measure.held_out import EDITS, HeldOutFabric, measure_errors, measure_timing, measure_truth

TRUTH = TruthOptions(relative_error=0.05, max_count=1024)


def test_more_points_err_less_and_the_truth_hardly(dataset, points, oracle):
    """MSE of k independent points falls about as 1/k; the truth's own draws leave next to nothing after its noise."""
    denim, _ = dataset
    found = [{record.metric: record for record in measure_errors(p, denim, 0)} for p in (*points, oracle)]
    one, two, sixteen, truth = (records["mse"].value for records in found)
    assert one > two > sixteen > 10 * abs(truth) and 4 < two / sixteen < 16
    assert found[0]["mse"].low < one < found[0]["mse"].high
    assert found[0]["mse_measured"].value - found[0]["truth_noise"].value == pytest.approx(one)
    assert found[0]["zero_answers"].value > found[2]["zero_answers"].value
    for name in ("colour_rrmse", "colour_rrmse_99", "rrmse_specular_warp", "rrmse_diffuse_weft"):
        assert found[0][name].value > found[2][name].value > found[3][name].value >= 0
    assert {(r.fabric, r.scene, r.method, r.setting, r.count) for r in (found[1]["mse"], found[1]["zero_answers"])} == {
        ("denim", "queries", "point_sampled", "k = 2", 400)
    }


def test_repeats_agree_random_methods_draw_anew_and_truth_reports_its_own_error(dataset, points):
    few = HeldOutFabric(dataset[0].fabric, dataset[0].queries.take(slice(100)), dataset[0].truth.take(slice(100)))
    first, again, other = (measure_errors(points[0], few, seed) for seed in (0, 0, 1))
    assert first == again and first[0].count == 100 and first[0].value != other[0].value
    record, truth = measure_truth(dataset[0]), dataset[0].truth
    size = np.linalg.norm(truth.mean, axis=1)
    ratio = np.linalg.norm(truth.standard_error, axis=1)[size > 0] / size[size > 0]
    assert record.value == pytest.approx(np.median(ratio))
    assert record.low < record.value < record.high


def test_what_answers_cost_is_measured_of_every_method_and_the_truth(dataset, points, oracle, options, monkeypatch):
    """All fabrics to add are new: tables that methods, or two measurements of one method, share would be found."""
    known, prepare = [], type(points[0]).prepare

    def noted(self, fabric):
        known.append(fabric.optics())
        prepare(self, fabric)

    monkeypatch.setattr(type(points[0]), "prepare", noted)
    methods = [*points[:2], oracle]
    whole = measure_timing(methods, dataset, TRUTH, options.model_copy(update={"threads": (2, 1, 2)}), unseen=dataset)
    assert [(r.setting, r.threads) for r in whole if r.metric == "time" and r.role] == [("k = 1", 1), ("k = 2", 1)]
    records = [record for record in whole if not record.role]
    times = {(r.method, r.setting, r.threads): r for r in records if r.metric == "time"}
    names = [("point_sampled", "k = 1"), ("point_sampled", "k = 2"), ("oracle", ""), ("truth", "")]
    assert list(times) == [(*name, threads) for name in names for threads in (1, 2)]
    assert all(r.low <= r.value <= r.high and r.unit == "ns/query" for r in times.values())
    assert all(len(r.samples) == r.count == 20 and r.value == np.median(r.samples) for r in times.values())
    assert times["point_sampled", "k = 1", 1].note == "64 queries a fabric"
    stored = {r.setting: r.value for r in records if r.metric == "bytes_stored" and r.method == "point_sampled"}
    assert stored == {one.setting: np.mean([one.bytes_stored(rows.fabric) for rows in dataset]) for one in methods[:2]}
    running = {(r.method, r.setting, r.threads): r.value for r in records if r.metric == "processor_time"}
    assert running.keys() == times.keys() and all(0 < running[key] < 1e-2 * times[key].value for key in times)
    # The oracle knows denim alone: no fabric can be added to it.
    adding = [r for r in records if r.metric == "prepare_time"]
    assert [(r.method, r.setting) for r in adding] == names[:2]
    assert all(r.unit == "ms" and len(r.samples) == r.count == EDITS for r in adding)
    named = [rows.fabric.optics() for rows in dataset]
    added = [optics for optics in known if optics not in named]
    assert len(added) == 2 * EDITS and all(one not in added[:index] for index, one in enumerate(added))
