import math

import pandas as pd
import pytest

from reports.tables.method_choice import MEASURED, PREDICTED, nearest, predictions, with_measured
from reports.tables.tradeoff import cheapest

ROWS = [("fast", "small", 100.0, 0.2), ("fast", "large", 100.0, 0.1), ("exact", "small", 1000.0, 0.02)]
ROWS += [("exact", "large", 500.0, 0.01), ("half", "small", 50.0, 0.01)]
SIZES = pd.DataFrame(ROWS, columns=["method", "size", "ns", "colour"]).assign(setting="")
SHARES = {"small": 0.25, "large": 0.75, "huge": 0.0}


def found(fallback=None, quadrature=(0.02, 1e5)):
    return predictions(SIZES, SHARES, 10_000, fallback or {"fast": 0.0, "exact": 0.0, "half": 0.0}, quadrature)


def test_errors_and_times_weigh_as_the_queries_occur_and_those_of_the_fallback_as_quadrature():
    table = found().set_index("method")
    assert table.loc["fast", "error"] == pytest.approx(math.sqrt(0.25 * 0.04 + 0.75 * 0.01))
    assert table.loc["exact", "ms"] == pytest.approx(1e-6 * 10_000 * (0.25 * 1000 + 0.75 * 500))
    # Nothing is known of it where large footprints occur.
    assert "half" not in table.index
    table = found({"fast": 0.5, "exact": 0.0}).set_index("method")
    assert table.loc["fast", "ms"] == pytest.approx(1e-6 * 10_000 * (0.5 * 100 + 0.5 * 1e5))
    assert table.loc["fast", "error"] == pytest.approx(math.sqrt(0.5 * 0.0175 + 0.5 * 0.0004))
    # A method that cannot be asked at all is left out.
    assert list(found({"exact": 0.0})["method"]) == ["exact"]


def test_a_wish_is_met_by_the_cheapest_and_by_what_was_measured_in_the_scene():
    table = found()
    assert [cheapest(table, "ms", error=limit).method for limit in (0.05, 0.5)] == ["exact", "fast"]
    assert [cheapest(table, "error", error=math.inf, ms=limit).method for limit in (5.0, math.inf)] == ["fast", "exact"]
    assert cheapest(table, "ms", error=1e-9, ms=1e-3) is None
    assert set(nearest(table, 1e-9, 1e-3)["method"]) == {"fast", "exact"}
    assert list(nearest(table, 0.05, 2.0)["method"]) == ["fast", "exact"]
    scenes = pd.DataFrame(
        [("attic", "fast", "", 0.3, 4.0, 0.1), ("cellar", "exact", "", 0.9, 9.0, 0.0)],
        columns=["scene", "method", "setting", "colour_rrmse", "frame_time", "fallback_share"],
    )
    table = with_measured(found(), scenes, "attic").set_index("method")
    assert (table.loc["fast", "error"], table.loc["fast", "ms"], table.loc["fast", "known"]) == (0.3, 4.0, MEASURED)
    assert table.loc["exact", "known"] == PREDICTED and len(table) == 2
