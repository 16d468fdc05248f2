import math

import pandas as pd
import pytest

from reports.over_seeds import by_seed, first_training, over_seeds, over_trainings, trainings
from reports.record import Provenance, Record


def trained(method, seed, metric="mse", value=1.0, fabric="denim", **numbers):
    provenance = Provenance(model=f"{method}{seed}", seed=seed)
    return Record(method=method, fabric=fabric, metric=metric, value=value, provenance=provenance, **numbers)


RECORDS = [
    trained("a", 7, value=1.0, standard_error=0.1, low=0.8, high=1.2, curve=((0.1, 1.0), (0.2, 2.0))),
    trained("a", 8, value=4.0, standard_error=0.3, low=3.0, high=4.4, curve=((0.1, 5.0), (0.2, 4.0))),
    trained("a", 9, value=1.0, standard_error=0.2, low=0.7, high=1.0, curve=((0.1, 0.0), (0.2, 0.0))),
    Record(method="a", metric="time", value=50.0),
    trained("a", 7, value=3.0, fabric="basket"),
    trained("b", 0, value=0.1),
    Record(method="points", fabric="denim", value=0.1),
]


def test_trainings_are_counted_by_their_seeds_and_their_numbers_become_means_of_one_subject():
    assert trainings(RECORDS) == {("a", ""): 3, ("b", ""): 1, ("points", ""): 0}
    mean, *others = over_trainings(RECORDS)
    assert (mean.value, mean.standard_error, mean.low, mean.high) == pytest.approx((2.0, 0.2, 1.5, 2.2))
    assert mean.curve == ((0.1, 2.0), (0.2, 2.0))
    assert others == RECORDS[3:], "other numbers are as they were"
    found = first_training(RECORDS[::-1])
    assert [one.value for one in found if one.method == "a" and one.metric == "mse"] == [3.0, 1.0]
    assert [one.curve for one in found if one.curve] == [RECORDS[0].curve]
    # The data set and the machine are part of what a number is of.
    other = [trained("a", seed, value=9.0) for seed in (7, 8)]
    moved = [one.model_copy(update={"provenance": one.provenance.model_copy(update={"dataset": "z"})}) for one in other]
    assert [one.value for one in over_trainings([*RECORDS[:3], *moved])] == [2.0, 9.0]


def test_each_training_is_seen_with_all_that_learns_nothing():
    parts = by_seed(RECORDS)
    assert [[(one.method, one.value) for one in part if one.method != "points"] for part in parts] == [
        [("a", 50.0), ("b", 0.1)],
        [("a", 1.0), ("a", 50.0), ("a", 3.0)],
        [("a", 4.0), ("a", 50.0)],
        [("a", 1.0), ("a", 50.0)],
    ]
    assert all(RECORDS[-1] in part for part in parts) and by_seed(RECORDS[3:5]) == by_seed([]) == []


@over_seeds(["method", "setting"], ["ratio"])
def ratios(records):
    """The value of `points` over that of each method, which is no mean of ratios."""
    errors = {one.method: one.value for one in records if one.metric == "mse" and one.fabric == "denim"}
    lines = [(method, "", errors["points"] / value) for method, value in errors.items()]
    return pd.DataFrame(lines, columns=["method", "setting", "ratio"])


def test_a_table_is_that_of_means_with_ranges_and_nonlinear_numbers_have_means_of_their_own():
    table = ratios(RECORDS).set_index("method")
    assert table.loc["a", ["ratio", "ratio_least", "ratio_most"]].tolist() == pytest.approx([0.05, 0.025, 0.1])
    assert table["seeds"].to_dict() == {"a": 3, "b": 1, "points": 0}
    for method in ("b", "points"):
        assert math.isnan(table["ratio_least"][method]) and math.isnan(table["ratio_most"][method])
    assert [*table.columns] == ["setting", "ratio", "seeds", "ratio_least", "ratio_most"]
    # A second training of which something else is known gives no range.
    known = ratios([*RECORDS, trained("b", 1, metric="extreme_error")]).set_index("method")
    assert math.isnan(known["ratio_most"]["b"]) and known["ratio_most"]["a"] == pytest.approx(0.1)
