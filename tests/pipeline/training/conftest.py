"""A tiny data set whose answers are a closed form: no ground truth is computed here."""

import numpy as np
import pytest

from pipeline.shards.manifest import Manifest, ShardEntry
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.shards.store import columns_of, write_columns
from pipeline.truth.query import Answers
from weaves.fabric import load_fabric

NAMES = ("polyester_lining", "cotton_twill")


def answered(fabric, queries):
    """Smooth in every input, periodic in the repeat, fading with the footprint; different for every fabric."""
    ends, picks = fabric.weave.repeat
    fade = 1.0 / (1.0 + queries.sigma)
    wave = 0.5 + 0.5 * fade * np.sin(2 * np.pi * queries.u / ends) * np.cos(2 * np.pi * queries.v / picks)
    tilt = queries.wi[:, 2] * (1.0 + queries.wo[:, 0])
    rough = fabric.warp.roughness
    mean = np.stack([0.1 * rough * wave * tilt, 0.05 * tilt, 0.2 * wave * tilt, 0.2 * (1 - wave) * tilt], axis=-1)
    return Answers.opaque(
        mean.astype(np.float32), np.full((len(mean), 4), 1e-3, np.float32), np.full(len(mean), 64, np.int32)
    )


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Return the folder of a data set with two seen fabrics."""
    folder = tmp_path_factory.mktemp("dataset")
    fabrics = {name: load_fabric(name) for name in NAMES}
    shards = []
    for name, fabric in fabrics.items():
        for split, rows, seed in (("train", 4096, 1), ("validation", 512, 2)):
            queries = draw_queries(QueryOptions(), fabric.weave.repeat, seed, 0, rows)
            file = f"part-{name}-{split}.parquet"
            write_columns(folder / file, "components", name, columns_of(queries, answered(fabric, queries)), {})
            shards.append(ShardEntry(file=file, fabric=name, split=split, start=0, rows=rows, sha256="0" * 64))
    roles = {"seen": list(NAMES), "population": [], "unseen": []}
    Manifest(name="tiny", fingerprint="f" * 16, roles=roles, fabrics=fabrics, about={}, shards=shards).save(folder)
    return folder
