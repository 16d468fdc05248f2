"""Tables of both sides of a cloth, by the kinds of queries that a shader is to answer."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final, NamedTuple

import numpy as np

from pipeline.analytic.soft_nodes.nodes import Table, tabulate
from pipeline.compiled.arrays import Float32
from pipeline.scenes.shade import colours
from weaves.errors import BadInput, one_line
from weaves.fabric import Fabric

BEHIND: Final = "behind"
CURVATURE: Final = "curvature"
KINDS: Final = (BEHIND, CURVATURE)
"""Kinds of queries beside light and viewer in front of flat cloth, as `pipeline.models` names them."""

EVERY: Final = "all"
"""All kinds."""


class Sides(NamedTuple):
    """A cloth.

    Attributes
    ----------
    front : Table
        Its front, with what light from behind and curved cloth need if these are wanted.
    back : Table or None
        Its back, if viewers behind it are wanted.
    colours : float32 (6, 3)
        k_s, k_d and k_dt, each of warp and weft, linear RGB.
    """

    front: Table
    back: Table | None
    colours: Float32


def wanted_kinds(names: Collection[str]) -> frozenset[str]:
    """Return the kinds that names choose; BadInput if one is none."""
    for name in names:
        if name not in (*KINDS, EVERY):
            raise BadInput("export", "--kind", one_line(name, 40), f"must be one of {', '.join((*KINDS, EVERY))}")
    return frozenset(KINDS if EVERY in names else names)


def tabulate_sides(fabric: Fabric, level: int, kinds: Collection[str]) -> Sides:
    """Return the tables of a fabric at a level of detail, for KINDS of queries."""
    behind, curved = BEHIND in kinds, CURVATURE in kinds
    reflected, transmitted = colours(fabric), colours(fabric, transmitted=True)
    return Sides(
        tabulate(fabric, behind=behind, level=level, curved=curved),
        tabulate(fabric.back(), behind=True, level=level) if behind else None,
        np.concatenate([reflected, transmitted[2:]]).astype(np.float32),
    )
