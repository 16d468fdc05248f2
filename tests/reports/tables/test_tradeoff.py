import math

import pandas as pd
import pytest

from reports.tables.tradeoff import cheapest, tradeoff_table

ERRORS = pd.DataFrame(
    [
        ("slow", "", "seen", 2, 0.01), ("fast", "k = 1", "seen", 2, 0.2), ("fast", "k = 2", "seen", 2, 0.1),
        ("poor", "", "seen", 2, 0.15), ("narrow", "", "seen", 1, 0.001), ("lost", "", "seen", 2, 0.0),
        ("untimed", "", "seen", 2, 0.001), ("fast", "k = 1", "unseen", 1, 0.3),
    ],
    columns=["method", "setting", "role", "fabrics", "colour_rrmse"],
).assign(colour_rrmse_least=math.nan, colour_rrmse_most=math.nan)  # fmt: skip
TIMING = pd.DataFrame(
    [
        ("slow", "", 900.0, 1.0), ("fast", "k = 1", 100.0, 1.0), ("fast", "k = 2", 200.0, 1.0),
        ("poor", "", 300.0, 1.0), ("narrow", "", 10.0, 1.0), ("lost", "", 10.0, 1.0), ("truth", "", 9e4, math.nan),
    ],
    columns=["method", "setting", "median_ns", "bytes_stored"],
).assign(unseen_ns=[math.nan, 150.0, *[math.nan] * 5])  # fmt: skip


def test_the_table_compares_what_answers_for_the_same_fabrics_and_names_the_cheapest():
    """A method of a single fabric has an easier mean; one below the noise has no error; what lacks a time is out."""
    found = {(row.role, row.method, row.setting): row.front for row in tradeoff_table(ERRORS, TIMING).itertuples()}
    front = [("seen", "slow", ""), ("seen", "fast", "k = 1"), ("seen", "fast", "k = 2"), ("unseen", "fast", "k = 1")]
    assert found == dict.fromkeys(front, True) | {("seen", name, ""): False for name in ("poor", "lost")}
    seen, unseen = (tradeoff_table(ERRORS, TIMING).query(f"role == '{role}'") for role in ("seen", "unseen"))
    assert unseen["ns"].tolist() == [150.0]
    both = pd.concat([ERRORS, ERRORS.tail(1).assign(setting="k = 2")])  # not timed on unseen fabrics
    assert tradeoff_table(both, TIMING).query("role == 'unseen' and front")["setting"].tolist() == ["k = 1"]
    assert [*tradeoff_table(both, TIMING.assign(unseen_ns=math.nan)).query("role == 'unseen'")["ns"]] == [100.0, 200.0]
    best = [cheapest(seen, "ns", error=limit) for limit in (0.25, 0.1, 0.05)]
    assert [(row.method, row.setting) for row in best] == [("fast", "k = 1"), ("fast", "k = 2"), ("slow", "")]
    assert cheapest(seen, "ns", error=0.005) is None
    for errors, timing in ((ERRORS[:0], TIMING), (ERRORS, TIMING[:0])):
        table = tradeoff_table(errors, timing)
        assert table.empty and "front" in table


def test_flicker_and_bytes_have_fronts_of_their_own():
    """Flicker counts by its distance from the truth's, on both sides; what was not measured is on no front."""
    timing = TIMING.assign(bytes_stored=[50.0, 10.0, 10.0, 70.0, 1.0, 1.0, math.nan])
    aliasing = pd.DataFrame(
        [("slow", "", "seen", -0.3), ("fast", "k = 1", "seen", 0.2), ("fast", "k = 2", "seen", -0.1)],
        columns=["method", "setting", "role", "flicker"],
    )
    table = tradeoff_table(ERRORS, timing, aliasing)
    seen = table[table["role"] == "seen"].set_index(["method", "setting"])
    assert seen.loc[("slow", ""), "flicker"] == pytest.approx(0.3) and math.isnan(seen.loc[("poor", ""), "flicker"])
    assert set(seen.index[seen["front_flicker"]]) == {("fast", "k = 1"), ("fast", "k = 2")}
    assert set(seen.index[seen["front_bytes"]]) == {("fast", "k = 2"), ("slow", "")}
    assert cheapest(seen.reset_index(), "ns", flicker=0.15).setting == "k = 2"
    assert cheapest(seen.reset_index(), "bytes_stored", error=0.15).setting == "k = 2"
