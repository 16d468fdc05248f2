"""A small benchmark: two fabrics, the truth as a method, and point sampling."""

import pytest

from pipeline.models.analytic.point_sampled import PointSampledOptions
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.measure.held_out import HeldOutFabric
from reports.options import BenchOptions
from reports.record import Record
from tests.pipeline.models.stand_ins import FakeMethod
from weaves.fabric import load_fabric

COARSE = TruthOptions(relative_error=0.2, min_count=256, max_count=256)

FEW = {"frames": 3, "timing_rows": 64, "timing_repeats": 20, "warm_up": 1, "truth": COARSE, "frame_truth": COARSE}
OPTIONS = BenchOptions(sphere_size=(32, 32), plane_size=(40, 32), frame_size=(32, 24), **FEW)


class Oracle(FakeMethod):
    """The truth itself, with other random numbers; knows denim alone."""

    name = "oracle"

    def covers(self, fabric):
        return fabric.name == "denim"

    def predict(self, fabric, queries, seed=0):
        fine = TruthOptions(relative_error=0.05, min_count=512, max_count=1024)
        return estimate(fabric, queries, fine, seed + 1).mean


@pytest.fixture(scope="session")
def options():
    return OPTIONS


@pytest.fixture(scope="session")
def points():
    return PointSampledOptions(counts=[1, 2, 16]).methods()


@pytest.fixture(scope="session")
def oracle():
    return Oracle()


@pytest.fixture(scope="session")
def dataset():
    """Held-out rows of two fabrics: [denim, twill_4_4]."""
    truth, rows = TruthOptions(relative_error=0.05, max_count=1024), []
    for fabric in map(load_fabric, ("denim", "twill_4_4")):
        queries = draw_queries(QueryOptions(), fabric.repeat, 1, 0, 400)
        rows.append(HeldOutFabric(fabric, queries, estimate(fabric, queries, truth, 1)))
    return rows


@pytest.fixture(scope="session")
def two_unseen(made_up):
    """`made_up` with held-out queries of a second unseen fabric: woven has four times its MSE, neumip knows it not."""
    more = []
    for record in made_up:
        if record.fabric == "twill_4_4" and record.scene == "queries" and record.method != "neumip":
            factor = 4 if (record.method, record.metric) == ("woven", "mse") else 1
            more.append(record.model_copy(update={"fabric": "unseen_0_irregular", "value": factor * record.value}))
    return made_up + more


METHODS = [("woven", ""), ("neumip", ""), *(("point_sampled", f"k = {k}") for k in (1, 2, 4, 16, 64))]


@pytest.fixture(scope="session")
def made_up():
    """Records of a whole benchmark with numbers from formulas: points fall as 1/k and cost k."""
    records = []
    fabrics = [("denim", "seen"), ("basket", "seen"), ("twill_4_4", "unseen")]
    for index, (method, setting) in enumerate(METHODS):
        count = float(setting.removeprefix("k = ") or 9)
        for scale, (fabric, role) in enumerate(fabrics, start=1):
            mse = scale * 1e-3 / count
            subject = Record(method=method, setting=setting, fabric=fabric, role=role)
            queries = subject.model_copy(update={"scene": "queries"})
            records.append(queries.of("mse", mse, 400, standard_error=mse / 20, low=0.9 * mse, high=1.1 * mse))
            records += [queries.of("mse_measured", mse + 1e-6, 400), queries.of("truth_noise", 1e-6, 400)]
            records.append(queries.of("zero_answers", 0.3 / count, 400))
            for name in ("colour_rrmse", "colour_rrmse_99", *(f"rrmse_{c}" for c in COMPONENTS)):
                records.append(queries.of(name, mse**0.5, 400))
            for scene in ("sphere", "plane"):
                records.append(subject.model_copy(update={"scene": scene}).of("mse", 2 * mse, 900))
            plane = subject.model_copy(update={"scene": "plane"})
            records.append(plane.of("flicker", -1e-3 if method == "woven" else 0.3 / count, 3))
            records.append(plane.of("excess_energy", -2e-3 if method == "woven" else 0.2 / count, 3))
            curve = tuple((0.05 + 0.1 * i, 1e-3 * 2.0**-i + 1e-4 / count) for i in range(5))
            records.append(plane.of("spectrum", 1e-3, 3, curve=curve))
        subject = Record(method=method, setting=setting)
        time = 400 * count + 10 * index
        records.append(subject.of("time", time, 25, low=0.97 * time, high=1.05 * time))
        records.append(subject.model_copy(update={"role": "unseen"}).of("time", 1.5 * time, 25))
        records.append(subject.of("bytes_stored", 2000.0 + index, 3))
    for fabric, role in fabrics:
        truth = Record(method="truth", fabric=fabric, role=role)
        records.append(truth.of("truth_relative_error", 0.0151, 400, low=0.01, high=0.02))
        curve = tuple((0.05 + 0.1 * i, 1e-3 * 2.0**-i) for i in range(5))
        plane = truth.model_copy(update={"scene": "plane"})
        records += [plane.of("motion", 0.01, 3), plane.of("spectrum", 1e-3, 3, curve=curve)]
    records.append(Record(method="truth").of("time", 2e5, 25, low=1.9e5, high=2.1e5))
    return records


def retrained(records, seeds):
    """Records in which methods were trained with several seeds: numbers as they are, 2 times and 3 times as large.

    Times and pictures are of the first training.
    """
    result = []
    for record in records:
        known = () if record.metric in ("time", "bytes_stored") else seeds.get(record.method, ())
        of_first = record.metric == "mse" and record.scene != "queries"
        for factor, seed in enumerate(known[:1] if of_first else known, start=1):
            numbers = {name: getattr(record, name) for name in ("value", "standard_error", "low", "high")}
            numbers = {name: factor * value for name, value in numbers.items() if value is not None}
            about = record.provenance.model_copy(update={"model": f"{seed}", "seed": seed})
            result.append(record.model_copy(update={**numbers, "provenance": about}))
        result += [] if known else [record]
    return result


@pytest.fixture(scope="session")
def three_trainings(made_up):
    """The benchmark `made_up` with `woven` trained three times, and `neumip` once."""
    return retrained(made_up, {"woven": (0, 1, 2), "neumip": (0,)})
