"""Every query is counted in one kind, and the kinds are those that `auto` takes."""

import numpy as np
import pytest

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.truth.effort import CLASSES, RECORDS, classify, measure
from weaves.fabric import load_fabric

FABRIC = load_fabric("denim")
OPTIONS = TruthOptions(relative_error=0.01, max_count=1 << 12)


def test_kinds_are_those_of_the_answers():
    queries = draw_queries(QueryOptions(), FABRIC.weave.repeat, 4, 0, 300)
    kinds = classify(FABRIC, queries, OPTIONS, 4)
    assert set(kinds.tolist()) == {0, 1, 2}
    table = estimate(FABRIC, queries, OPTIONS.model_copy(update={"estimator": "node_table"}), 4)
    auto = estimate(FABRIC, queries, OPTIONS, 4)
    # What `table` says is said by a table alone, whatever the seed; everything else is not the same with another.
    same = (auto.mean == table.mean).all(axis=1) & (auto.standard_error == table.standard_error).all(axis=1)
    assert same.sum() > 100 and not kinds[same].any()
    other = estimate(FABRIC, queries, OPTIONS, 99)
    np.testing.assert_array_equal((auto.mean == other.mean).all(axis=1), kinds == 0)
    # Another least count changes what is sampled and nothing else.
    more = estimate(FABRIC, queries, OPTIONS.model_copy(update={"min_count": 2048}), 4)
    np.testing.assert_array_equal(auto.mean[kinds < 2], more.mean[kinds < 2])


def test_what_the_table_can_do_everything_about_is_never_sampled():
    """At 100 % asked for, every answer is the table's own."""
    queries = draw_queries(QueryOptions(), FABRIC.weave.repeat, 4, 0, 50)
    anything = OPTIONS.model_copy(update={"relative_error": 1.0})
    assert not classify(FABRIC, queries, anything, 4).any()


def test_shares_add_up_and_records_bring_them_back():
    found = list(measure(rows=100, fabrics=["basket"]))
    assert [row.kind for row in found] == list(CLASSES)
    assert sum(row.share for row in found) == pytest.approx(1.0)
    assert RECORDS.from_records(RECORDS.to_records(found)) == found
