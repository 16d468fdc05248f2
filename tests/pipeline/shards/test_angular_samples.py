import numpy as np

from pipeline.shards.store import queries_of, rows_of
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.shards.extra import SAMPLES
from weaves.fabric import load_fabric

LINING, BASKET, SHANTUNG = (load_fabric(name) for name in ("polyester_lining", "basket", "silk_shantung"))


def test_samples_are_the_truth_at_the_texels():
    """Texel (row, column) lies at v = row, u = column: on a 6 x 8 repeat no mistake of order can hide."""
    exact = TruthOptions(estimator="owen", min_count=4096, max_count=4096)
    rows, columns = SAMPLES.grid(SHANTUNG)
    asked = SAMPLES.model_copy(update={"truth": exact, "samples": 1})
    queries, answers = rows_of(asked.answer(SHANTUNG, 0, rows * columns))
    row, column = 3, 9
    u, v, sigma = (np.float32([x]) for x in (column / 2 + 0.25, row / 2 + 0.25, 0.25))
    answer = estimate(SHANTUNG, Queries.round(u, v, sigma, queries.wi[:1], queries.wo[:1]), exact, 7)
    found = answers.mean[row * columns + column]
    assert np.abs(found - answer.mean[0]).max() < 5 * answer.standard_error.max()
    assert np.ptp(answers.mean, axis=0).max() > 0.1 * answer.mean.max()


def test_all_texels_of_a_fabric_are_seen_under_directions_of_their_own():
    lining, basket = (queries_of(SAMPLES.answer(fabric, 0, SAMPLES.count(fabric))) for fabric in (LINING, BASKET))
    rows, columns = SAMPLES.grid(LINING)
    assert SAMPLES.count(LINING) == 4 * rows * columns == 4 * 16
    for directions in (lining.wi, lining.wo):
        by_sample = directions.reshape(4, rows * columns, 3)
        assert (by_sample == by_sample[:, :1]).all()
        assert len(np.unique(by_sample[:, 0], axis=0)) == 4
    assert not np.isin(lining.wi, basket.wi).any()


def test_rows_are_the_same_in_any_cut_and_for_any_number_of_samples():
    """Cuts within a sample, and more samples, change no row."""
    told = []
    whole = SAMPLES.answer(LINING, 0, 64, told.append)
    assert told[-1] == 64
    for size, parts in ((64, [(5, 30), (35, 29)]), (9, [(5, 59)])):
        cut = SAMPLES.model_copy(update={"samples": size})
        found = [cut.answer(LINING, start, count) for start, count in parts]
        for name, column in whole.items():
            np.testing.assert_array_equal(np.concatenate([part[name] for part in found]), column[5:])
