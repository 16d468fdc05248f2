"""Cloth and queries moved by a symmetry, for tests of what mirrors and exchanges change."""

import torch

from pipeline.models.woven.standard_position import Placement, moved
from pipeline.truth.query import Queries


def image_of(symmetry, cloth, asked):
    """Return the image of a cloth and of queries about it, and the placement that moved them."""
    one = Placement(
        torch.tensor([[symmetry.mirror_x, symmetry.mirror_y]]),
        torch.tensor([[symmetry.exchange]]),
        torch.zeros(1, 2),
        torch.ones(1, 2),
    )
    ends, picks = cloth.weave.repeat
    u, v, wi, wo = one.move(*(torch.from_numpy(c)[None] for c in (asked.u / ends, asked.v / picks, asked.wi, asked.wo)))
    image = moved(cloth, symmetry)
    ends, picks = image.weave.repeat
    there = Queries.round(u[0].numpy() * ends, v[0].numpy() * picks, asked.sigma, wi[0].numpy(), wo[0].numpy())
    return image, there, one
