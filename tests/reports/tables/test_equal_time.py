import math

import pytest

from reports.measure.by_size import MEASURES
from reports.record import Record
from reports.tables.equal_time import equal_time_table, error_at, size_table


def test_curves_are_straight_in_both_logarithms_and_methods_compared_at_their_own_time():
    """Error falls as time^-1/2, as that of random points does: exactly so at times between the settings.

    A setting that a faster one beats does not help its family; from what is lost in noise on nothing is left to beat.
    """
    curve = [(t, t**-0.5) for t in (100.0, 400.0, 1600.0)]
    assert error_at(curve, 250.0) == pytest.approx(250.0**-0.5) and math.isnan(error_at(curve, 99.0))
    assert error_at(curve, 1e6) == pytest.approx(1600.0**-0.5)
    assert error_at([(100.0, 0.1), (200.0, 0.5), (400.0, 0.05)], 200.0) == pytest.approx(math.sqrt(0.1 * 0.05))
    curve = [(100.0, 0.2), (200.0, 0.0), (400.0, 0.1)]
    assert error_at(curve, 150.0) == pytest.approx(0.2) and error_at(curve, 300.0) == error_at(curve, 500.0) == 0.0
    table = equal_time_table(size_table(list(records())))
    assert set(table["method"]) == {"ours"} and set(table["rival"]) == {"points"}
    ratio = table[table["measure"] == "specular"].set_index("size")["ratio"]
    assert ratio["below .1"] == pytest.approx(0.5) and ratio["1 to 3"] == pytest.approx(4.0)
    table = equal_time_table(size_table(list(records(TIMES | FRONT_TIMES, ERRORS | FRONT_ERRORS))))
    assert set(zip(table["method"], table["rival"], strict=True)) == {
        ("ours", "points"), ("ours", "soft_nodes"), ("soft_nodes", "points"),
    }  # fmt: skip
    own = table[(table["method"] == "soft_nodes") & (table["measure"] == "specular")].set_index(["setting", "size"])
    assert own["ratio"]["k = 1", "1 to 3"] == pytest.approx(4.0)
    assert own["ratio"]["k = 2", "below .1"] == pytest.approx(0.5)


TIMES = {("ours", ""): 200.0, ("points", "k = 1"): 100.0, ("points", "k = 4"): 400.0}
ERRORS = {("ours", ""): (0.1, 0.1), ("points", "k = 1"): (0.1, 0.8), ("points", "k = 4"): (0.025, 0.2)}
FRONT_TIMES = {("soft_nodes", "k = 1"): 100.0, ("soft_nodes", "k = 2"): 200.0}
FRONT_ERRORS = {("soft_nodes", "k = 1"): (0.2, 0.2), ("soft_nodes", "k = 2"): (0.1, 0.1)}


def records(times=TIMES, errors=ERRORS):
    """One method, and a rival with two settings that is better at small footprints and worse at large ones."""
    for (method, setting), ns in times.items():
        subject = Record(method=method, setting=setting)
        yield subject.of("size_time", ns, 10, curve=((0.0, ns), (1.0, ns)))
        small, large = errors[method, setting]
        for metric, _ in MEASURES.values():
            yield subject.of(metric, 0.1, 10, curve=((0.0, small), (1.0, large)))
