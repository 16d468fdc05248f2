"""Cloth and queries moved by a symmetry, for tests of what mirrors and exchanges change."""

import torch

from pipeline.models.woven.standard_position import moved, placement
from pipeline.truth.query import Queries


def image_of(symmetry, cloth, asked):
    """Return the image of a cloth and of queries about it, and the placement that moved them."""
    place = placement(cloth, symmetry, (0, 0))
    ends, picks = cloth.weave.repeat
    columns = asked.u / ends, asked.v / picks, asked.wi, asked.wo
    u, v, wi, wo = (part[0].numpy() for part in place.move(*(torch.from_numpy(column)[None] for column in columns)))
    image = moved(cloth, symmetry)
    ends, picks = image.weave.repeat
    return image, Queries.round(u * ends, v * picks, asked.sigma, wi, wo), place
