import numpy as np
import pytest

from pipeline.shards.store import queries_of, rows_of
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.opacity import grazing_cosine, opacity
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.shards.extra import GRAZING, OPACITY, SAMPLES
from weaves.fabric import load_fabric

DENIM, LINING, BASKET, SHANTUNG = map(load_fabric, ("denim", "polyester_lining", "basket", "silk_shantung"))


def test_samples_are_the_truth_at_the_texels_and_opacities_the_truths():
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
    column = OPACITY.answer(DENIM, 0, 512)
    wo = np.stack([column[f"wo_{axis}"] for axis in "xyz"], axis=-1)
    queries = Queries.round(column["u"], column["v"], column["sigma"], wo, wo)
    exactly = TruthOptions(min_count=256, max_count=256)
    exact, error = opacity(DENIM, queries._replace(curvature=column["curvature"]), exactly, seed=9)
    doubt = np.sqrt(np.square(error) + 0.25 / 32)
    assert (np.abs(column["opacity"] - exact) < 4 * doubt + 1e-6).mean() > 0.99
    assert ((exact > 0.02) & (exact < 0.98)).mean() > 0.25
    assert column["curvature"].max() <= 0.5


def test_all_texels_are_seen_under_directions_of_their_own_the_same_in_any_cut():
    lining, basket = (queries_of(SAMPLES.answer(fabric, 0, SAMPLES.count(fabric))) for fabric in (LINING, BASKET))
    rows, columns = SAMPLES.grid(LINING)
    assert SAMPLES.count(LINING) == 4 * rows * columns == 4 * 16
    for directions in (lining.wi, lining.wo):
        by_sample = directions.reshape(4, rows * columns, 3)
        assert (by_sample == by_sample[:, :1]).all()
        assert len(np.unique(by_sample[:, 0], axis=0)) == 4
    assert not np.isin(lining.wi, basket.wi).any()
    cases = (OPACITY, DENIM), (OPACITY, BASKET), (OPACITY.model_copy(update={"seed": 1}), DENIM)
    drawn = [rows.answer(fabric, 0, 16)["sigma"] for rows, fabric in cases]
    assert len(np.unique(np.concatenate(drawn))) == 48
    told = []
    whole = SAMPLES.answer(LINING, 0, 64, told.append)
    assert told[-1] == 64
    for size, parts in ((64, [(5, 30), (35, 29)]), (9, [(5, 59)])):
        cut = SAMPLES.model_copy(update={"samples": size})
        found = [cut.answer(LINING, start, count) for start, count in parts]
        for name, column in whole.items():
            np.testing.assert_array_equal(np.concatenate([part[name] for part in found]), column[5:])


@pytest.mark.parametrize("footprint", ["gaussian", "box"])
def test_grazing_rows_are_mean_and_variance_of_cosines(footprint):
    column = GRAZING.model_copy(update={"footprint": footprint}).answer(DENIM, 0, 64)
    column = {name: values.astype(np.float64) for name, values in column.items()}
    random, shape = np.random.default_rng(2), (2, 64, 64)
    unit = random.standard_normal(shape) if footprint == "gaussian" else random.uniform(-1, 1, shape) * 3**0.5
    u, v, sigma, kappa = (column[name][:, None] for name in ("u", "v", "sigma", "curvature"))
    azimuth = np.arctan2(column["wo_y"], column["wo_x"])[:, None]
    cosines = grazing_cosine(DENIM, u + sigma * unit[0], v + sigma * unit[1], azimuth, kappa) / np.sqrt(kappa)
    # Both are means over 64 points.
    limit = 5 * np.sqrt(2 / 64) * cosines.std(axis=1)
    assert (np.abs(column["grazing_mean"] - cosines.mean(axis=1)) < limit).all()
    assert column["grazing_variance"].mean() == pytest.approx(cosines.var(axis=1).mean(), rel=0.2)
