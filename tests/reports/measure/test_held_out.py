import numpy as np
import pytest

from reports.measure.held_out import EDITS, measure_errors, measure_timing, measure_truth


def by_metric(records):
    return {record.metric: record for record in records}


def test_more_points_err_less_and_the_truth_hardly(dataset, points, oracle, options):
    """MSE of k independent points falls about as 1/k; the truth's own draws leave next to nothing after its noise."""
    manifest, folder = dataset
    found = [by_metric(measure_errors(p, manifest, folder, "denim", "seen", options)) for p in (*points, oracle)]
    one, two, sixteen, truth = (records["mse"].value for records in found)
    assert one > two > sixteen > 10 * abs(truth)
    assert 4 < two / sixteen < 16
    assert found[0]["mse"].count == 400
    assert found[0]["mse"].low < one < found[0]["mse"].high
    assert found[0]["mse_measured"].value - found[0]["truth_noise"].value == pytest.approx(one)
    assert found[0]["zero_answers"].value > found[2]["zero_answers"].value
    for name in ("colour_rrmse", "colour_rrmse_99", "rrmse_specular_warp", "rrmse_diffuse_weft"):
        assert found[0][name].value > found[2][name].value > found[3][name].value >= 0


def test_records_name_their_subject(dataset, points, options):
    manifest, folder = dataset
    record = measure_errors(points[1], manifest, folder, "twill_4_4", "unseen", options)[0]
    assert (record.method, record.setting, record.fabric, record.role, record.scene) == (
        "point_sampled",
        "k = 2",
        "twill_4_4",
        "unseen",
        "queries",
    )


def test_rows_limit_the_queries_and_repeats_agree(dataset, points, options):
    manifest, folder = dataset
    few = options.model_copy(update={"rows": 100})
    first, again = (measure_errors(points[0], manifest, folder, "denim", "seen", few) for _ in range(2))
    assert first == again
    assert first[0].count == 100
    other = measure_errors(points[0], manifest, folder, "denim", "seen", few.model_copy(update={"seed": 1}))
    assert first[0].value != other[0].value


def test_truth_reports_its_own_error(dataset, options):
    manifest, folder = dataset
    (record,) = measure_truth(manifest, folder, "denim", "seen", options)
    _, answers = manifest.read(folder, "denim", "test")
    ratio = np.linalg.norm(answers.standard_error, axis=1) / np.linalg.norm(answers.mean, axis=1)
    assert record.value == pytest.approx(np.median(ratio[np.isfinite(ratio)]))
    assert record.low < record.value < record.high


def test_what_answers_cost_is_measured_of_every_method_and_the_truth(dataset, points, oracle, options):
    manifest, folder = dataset
    records = measure_timing([*points, oracle], manifest, folder, options.model_copy(update={"threads": (2, 1, 2)}))
    times = {(r.method, r.setting, r.threads): r for r in records if r.metric == "time"}
    names = [("point_sampled", f"k = {k}") for k in (1, 2, 16)] + [("oracle", ""), ("truth", "")]
    assert list(times) == [(*name, threads) for name in names for threads in (1, 2)]
    assert all(r.low <= r.value <= r.high and r.unit == "ns/query" for r in times.values())
    assert all(len(r.samples) == r.count == 20 and r.value == np.median(r.samples) for r in times.values())
    assert times["truth", "", 1].value > times["point_sampled", "k = 1", 1].value
    assert times["point_sampled", "k = 1", 1].note == "64 queries a fabric"
    stored = {r.setting: r.value for r in records if r.metric == "bytes_stored" and r.method == "point_sampled"}
    assert stored == {"k = 1": 1000, "k = 2": 2000, "k = 16": 16000}
    # The oracle knows denim alone: no fabric can be added to it.
    adding = [r for r in records if r.metric == "prepare_time"]
    assert [(r.method, r.setting) for r in adding] == names[:3]
    assert all(r.unit == "ms" and len(r.samples) == r.count == EDITS for r in adding)


def test_fabrics_to_add_are_all_new(dataset, points, options):
    """No two edits are the same, of one method or of several: tables that methods share would be found."""
    manifest, folder = dataset
    known = []

    class Noting(type(points[0])):
        def prepare(self, fabric):
            known.append(fabric.optics())
            super().prepare(fabric)

    measure_timing([Noting(1), Noting(2)], manifest, folder, options)
    named = [fabric.optics() for fabric in manifest.fabrics.values()]
    added = [optics for optics in known if optics not in named]
    assert len(added) == 2 * EDITS
    assert all(one not in added[:index] for index, one in enumerate(added))
