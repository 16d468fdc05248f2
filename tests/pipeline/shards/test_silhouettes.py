"""Rows about the silhouette against other points of the truth."""

import numpy as np
import pytest

from pipeline.truth.geometry.opacity import grazing_cosine, opacity
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from tests.pipeline.shards.extra import GRAZING, OPACITY
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")


def test_opacities_are_the_truths():
    column = OPACITY.answer(DENIM, 0, 512)
    wo = np.stack([column[f"wo_{axis}"] for axis in "xyz"], axis=-1)
    queries = Queries.round(column["u"], column["v"], column["sigma"], wo, wo)
    exactly = TruthOptions(min_count=256, max_count=256)
    exact, error = opacity(DENIM, queries._replace(curvature=column["curvature"]), exactly, seed=9)
    doubt = np.sqrt(np.square(error) + 0.25 / 32)
    assert (np.abs(column["opacity"] - exact) < 4 * doubt + 1e-6).mean() > 0.99
    assert ((exact > 0.02) & (exact < 0.98)).mean() > 0.25
    assert column["curvature"].max() <= 0.5


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


def test_fabrics_and_seeds_draw_other_queries():
    basket, other = load_fabric("basket"), OPACITY.model_copy(update={"seed": 1})
    drawn = [
        rows.answer(fabric, 0, 16)["sigma"] for rows, fabric in ((OPACITY, DENIM), (OPACITY, basket), (other, DENIM))
    ]
    assert len(np.unique(np.concatenate(drawn))) == 48
