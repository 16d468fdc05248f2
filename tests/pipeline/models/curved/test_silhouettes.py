"""What the silhouette is learnt from, against other points of the truth."""

import numpy as np
import pytest
import torch

from pipeline.models.curved.options import CurvedOptions
from pipeline.models.curved.silhouettes import View, draw_silhouettes
from pipeline.truth.geometry.opacity import grazing_cosine, opacity
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

SMALL = CurvedOptions(silhouette_rows=512, silhouette_points=32, silhouette_sigma=(0.5, 8.0))
DENIM = load_fabric("denim")


def test_questions_about_the_silhouette_have_the_truths_answers():
    drawn = draw_silhouettes(SMALL, DENIM)
    column = {name: drawn.get_buffer(name).numpy() for name in (*View._fields, "target")}
    ends, picks = DENIM.weave.repeat
    asked = Queries.round(column["u"] * ends, column["v"] * picks, column["sigma"], column["wo"], column["wo"])
    asked = asked._replace(curvature=column["curvature"])
    exact, error = opacity(DENIM, asked, TruthOptions(min_count=256, max_count=256), seed=9)
    doubt = np.sqrt(np.square(error) + 0.25 / 32)
    assert (np.abs(column["target"][:, 0] - exact) < 4 * doubt + 1e-6).mean() > 0.99
    assert ((exact > 0.02) & (exact < 0.98)).mean() > 0.25
    assert column["curvature"].max() <= 0.5
    again = draw_silhouettes(SMALL, DENIM)
    assert torch.equal(again.get_buffer("target"), drawn.get_buffer("target"))


def test_grazing_questions_have_the_mean_and_variance_of_cosines():
    options = SMALL.model_copy(update={"silhouette": "grazing", "silhouette_rows": 64, "silhouette_points": 1024})
    drawn = draw_silhouettes(options, DENIM)
    column = {name: drawn.get_buffer(name).numpy().astype(np.float64) for name in (*View._fields, "target")}
    spread = np.random.default_rng(2).standard_normal((2, 64, 64)) * column["sigma"][:, None]
    ends, picks = DENIM.weave.repeat
    azimuth = np.arctan2(column["wo"][:, 1], column["wo"][:, 0])[:, None]
    kappa = column["curvature"][:, None]
    x, y = column["u"][:, None] * ends + spread[0], column["v"][:, None] * picks + spread[1]
    cosines = grazing_cosine(DENIM, x, y, azimuth, kappa) / np.sqrt(kappa)
    # Both are means over 64 points.
    limit = 5 * np.sqrt(2 / 64) * cosines.std(axis=1)
    assert (np.abs(column["target"][:, 0] - cosines.mean(axis=1)) < limit).all()
    assert column["target"][:, 1].mean() == pytest.approx(cosines.var(axis=1).mean(), rel=0.2)
