import numpy as np
import pytest

from pipeline.analytic.soft_nodes.features import EXCHANGED, EXCHANGED_SIGN, read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.models.woven.standard_position import SYMMETRIES, moved
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.images import image_of
from tests.pipeline.truth.cloths import woven
from tests.presets import slow

SIZES = {"narrow": (0.05, 0.24), "middle": (0.25, 1.0), "wide": (3.0, 8.0)}
GENERATORS = [SYMMETRIES[1], SYMMETRIES[2], SYMMETRIES[4]]


@pytest.fixture(scope="module")
def lopsided():
    """A cloth without symmetries of its own, its yarns unlike and with gaps."""
    return woven("denim", ("##.#", ".##.", "#..#"), warp={"width": 0.8, "twist": 20.0})


@pytest.fixture(scope="module")
def table(lopsided):
    return tabulate(lopsided)


def test_features_are_bounded_where_walls_are_most_of_what_is_seen():
    """High yarns that hardly bend end in steps; some shares of the bare sums reach the bound."""
    stepped = woven("denim", ("##.#", ".##.", "#..#"), warp={"bend": 5.0, "relief": 1.8}, weft={"bend": 5.0})
    asked = draw_queries(QueryOptions(sigma=(0.1, 1.0), stretch=4.0), stepped.weave.repeat, 1, 0, 4000)
    features = read_queries(tabulate(stepped), asked).features
    doubts = features[:, [4, 5, 12, 13]]
    assert np.abs(features).max() <= 4.0 and features[:, [1, 2, 3, 9, 10, 11]].max() == 2.0
    assert doubts.min() == 0.0 and doubts.max() <= 1.0


@pytest.mark.parametrize("symmetry", [GENERATORS[0], slow(GENERATORS[1]), GENERATORS[2]])
def test_mirror_images_have_the_same_features_and_exchanges_permute_them(symmetry, lopsided, table):
    """Most rows to rounding, of grids to 8 bits too; where a node lies on the border of two cells, rounding decides."""
    image_table = tabulate(moved(lopsided, symmetry))
    for size in SIZES.values():
        asked = draw_queries(QueryOptions(sigma=size), lopsided.weave.repeat, 1, 0, 100)
        _, there, _ = image_of(symmetry, lopsided, asked)
        here, (found, components, _) = read_queries(table, asked), read_queries(image_table, there)
        expected = here[0][:, EXCHANGED] * EXCHANGED_SIGN if symmetry.exchange else here[0]
        error = np.abs(found - expected).max(axis=1)
        assert np.median(error) < 2e-3
        assert np.quantile(error, 0.9) < 0.05
        swapped = here[1][:, [1, 0, 3, 2]] if symmetry.exchange else here[1]
        assert np.median(np.abs(components - swapped).max(axis=1)) < 1e-3
