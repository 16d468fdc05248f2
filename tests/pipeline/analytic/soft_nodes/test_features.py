"""Symmetries of the features: what a network need not learn, and what exchanging warp and weft does."""

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.features import (
    EXCHANGED,
    EXCHANGED_SIGN,
    FEATURES,
    OF_QUERY,
    cloth_features,
    read_queries,
)
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.shards.queries import QueryOptions, draw_queries
from weaves.draft import Matrix
from weaves.fabric import load_fabric

SIZES = {"narrow": (0.05, 0.24), "middle": (0.25, 1.0), "wide": (3.0, 8.0)}


@pytest.fixture(scope="module")
def lopsided():
    """A cloth without symmetries of its own, its yarns unlike and with gaps."""
    fabric = load_fabric("denim")
    warp = fabric.warp.model_copy(update={"width": 0.8, "twist": 20.0})
    draft = Matrix(rows=("##.#", ".##.", "#..#"))
    return fabric.model_copy(update={"draft": draft, "warp": warp})


@pytest.fixture(scope="module")
def table(lopsided):
    return tabulate(lopsided)


def test_exchanging_twice_changes_nothing():
    np.testing.assert_array_equal(EXCHANGED[EXCHANGED], np.arange(FEATURES))
    np.testing.assert_array_equal(EXCHANGED_SIGN[EXCHANGED] * EXCHANGED_SIGN, 1.0)


def test_the_last_features_are_the_cloths_own(lopsided, table):
    asked = draw_queries(QueryOptions(), lopsided.weave.repeat, 1, 0, 20)
    features = read_queries(table, asked).features
    np.testing.assert_array_equal(features[:, OF_QUERY:], np.tile(cloth_features(table), (20, 1)))
    assert np.ptp(features[:, :OF_QUERY], axis=0).min() > 0.0


def test_rows_do_not_depend_on_each_other(lopsided, table):
    asked = draw_queries(QueryOptions(), lopsided.weave.repeat, 3, 0, 60)
    whole, part = read_queries(table, asked), read_queries(table, asked.take(slice(20, 40)))
    for all_rows, some in zip(whole, part, strict=True):
        np.testing.assert_array_equal(some, all_rows[20:40])


@pytest.mark.parametrize("rows", [("###", "#.#", ".#."), ("#..", "#.#", "##."), ("##", "##")])
def test_yarns_that_never_change_side(rows):
    """A float without end is straight: numbers stay finite, beneath and on top, with and without room around."""
    denim = load_fabric("denim")
    for width in (0.7, 1.0):
        families = {family: getattr(denim, family).model_copy(update={"width": width}) for family in ("warp", "weft")}
        fabric = denim.model_copy(update={**families, "draft": Matrix(rows=rows)})
        asked = draw_queries(QueryOptions(), fabric.weave.repeat, 4, 0, 200)
        for found in read_queries(tabulate(fabric), asked):
            assert np.isfinite(found).all()
