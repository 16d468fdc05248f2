"""A tiny data set whose answers are a closed form: no ground truth is computed here."""

import numpy as np
import pytest

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Answers
from tests.datasets import write_dataset
from weaves.fabric import load_fabric

NAMES = ("polyester_lining", "cotton_twill")


def answered(fabric, queries):
    """Smooth in every input, periodic in the repeat, fading with the footprint; different for every fabric."""
    ends, picks = fabric.weave.repeat
    fade = 1.0 / (1.0 + queries.sigma)
    wave = 0.5 + 0.5 * fade * np.sin(2 * np.pi * queries.u / ends) * np.cos(2 * np.pi * queries.v / picks)
    tilt = queries.wi[:, 2] * (1.0 + queries.wo[:, 0])
    columns = [0.1 * fabric.warp.roughness * wave * tilt, 0.05 * tilt, 0.2 * wave * tilt, 0.2 * (1 - wave) * tilt]
    mean = np.stack(columns, axis=-1).astype(np.float32)
    return Answers.opaque(mean, np.full_like(mean, 1e-3), np.full(len(mean), 64, np.int32))


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    folder, parts = tmp_path_factory.mktemp("dataset"), []
    for fabric in map(load_fabric, NAMES):
        for split, rows, seed in (("train", 4096, 1), ("validation", 512, 2)):
            queries = draw_queries(QueryOptions(), fabric.weave.repeat, seed, 0, rows)
            parts.append((fabric.name, split, 0, queries, answered(fabric, queries)))
    write_dataset(folder, {"seen": list(NAMES), "population": [], "unseen": []}, parts)
    return folder
