"""Measured samples of a patch, and a trained network of RGB."""

import numpy as np
import safetensors.torch
import torch

from pipeline.fingerprint import IDENTITY
from pipeline.models.card import write_model
from pipeline.models.unified_btf.model import RgbBtfNetwork
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.shards.sample_file import MeasuredSamples
from tests.pipeline.models.stand_ins import SMALL, card_of
from weaves.fabric import load_fabric

RGB = SMALL["unified_btf"].model_copy(update={"head": "rgb", "name": "btf_rgb"})
ROWS, COLUMNS = 4, 6


def network():
    torch.manual_seed(1)
    model = RgbBtfNetwork(RGB).eval()
    model.start_at(torch.full((2, 4), 0.1))
    with torch.no_grad():
        model.decoder[-1].weight.mul_(20.0)
    return model


def measured(directions=8, seed=0):
    """Return samples of all texels under the same pairs of directions, in random order."""
    random = np.random.default_rng(seed)
    drawn = draw_queries(QueryOptions(max_angle=70.0), (1, 1), seed, 0, directions)
    pair, texel = np.divmod(random.permutation(directions * ROWS * COLUMNS), ROWS * COLUMNS)
    rgb = random.uniform(0.0, 0.2, (len(texel), 3)).astype(np.float32)
    return MeasuredSamples((ROWS, COLUMNS), texel, drawn.wi[pair], drawn.wo[pair], rgb), pair


def write_trained(folder):
    """Write a network of RGB to a folder, and return it."""
    card = card_of(load_fabric("polyester_lining")) | {
        "options": RGB.model_dump(mode="json", context=IDENTITY),
        "version": {"model": RGB.version},
    }
    write_model(folder, safetensors.torch.save(network().state_dict()), card)
    return folder
