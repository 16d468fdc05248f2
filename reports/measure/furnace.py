"""The white furnace: the share of even light from all directions that a method returns, at most 1 in nature.

    E(wo) = integral of f_P(wi, wo) over all wi on the viewer's side = 2 pi <f_P> over directions even in solid angle

The directions are a shifted R2 sequence, the same for every method. Figures are the worst over positions, footprints
and angles of the viewer: the diffuse components with k_d = 1, the specular ones with k_s = 1, the brightest channel of
the fabric in its own colours. A method that answers light from behind has a fourth: the brightest channel of all that
comes from both sides, with what goes straight through gaps and yarns.
"""

import itertools
import math
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float64
from pipeline.models.fallback import Fallback
from pipeline.models.method import Method
from pipeline.scenes.shade import colours
from pipeline.truth.query import Queries
from reports.record import Record
from weaves.errors import BadInput
from weaves.fabric import Fabric

_ANGLES: Final = (0.0, 30.0, 60.0, 80.0, 88.0)  # angles of the viewer to the normal, degrees
_FOOTPRINTS: Final = (0.06, 0.3, 1.5, 8.0)  # standard deviations, yarn spacings

DIRECTIONS: Final = 256
"""Directions of light for each patch: an integral of a highlight of alpha = .1 is good to about 1 %."""

_AZIMUTHS = (0.4, 2.1)
_PLACES = 4


def furnace_queries(repeat: tuple[int, int]) -> Queries:
    """Return the queries: `DIRECTIONS` lights in turn for every patch."""
    steps = np.arange(1, DIRECTIONS + 1)[:, None] * (0.7548776662466927, 0.5698402909980532)
    z, turn = (0.5 + steps).T % 1.0
    z = np.maximum(z, 1e-3)
    sine, turn = np.sqrt(1.0 - z * z), 2.0 * math.pi * turn
    wi = np.stack([sine * np.cos(turn), sine * np.sin(turn), z], axis=-1)
    places = np.random.default_rng(0).random((_PLACES, 2)) * repeat
    patches = list(itertools.product(places.tolist(), _FOOTPRINTS, _ANGLES, _AZIMUTHS))
    centre = np.array([[*place, sigma] for place, sigma, _, _ in patches])
    theta, phi = np.radians([p[2] for p in patches]), np.array([p[3] for p in patches])
    wo = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    u, v, sigma = (np.repeat(column, DIRECTIONS).astype(np.float32) for column in centre.T)
    every = np.tile(wi, (len(patches), 1)).astype(np.float32)
    return Queries.round(u, v, sigma, every, np.repeat(wo, DIRECTIONS, axis=0).astype(np.float32))


def measure_furnace(method: Method, fabric: Fabric) -> list[Record]:
    """Return the worst figures of a method on a fabric."""
    method.prepare(fabric)
    queries = furnace_queries(fabric.weave.repeat)
    energy = _energy(method, fabric, queries)
    coloured = energy @ colours(fabric)
    figures = [energy[:, 2:].sum(axis=1), energy[:, :2].sum(axis=1), coloured.max(axis=1)]
    try:
        behind = _energy(method, fabric, queries._replace(wi=queries.wi * np.array([1.0, 1.0, -1.0], np.float32)))
    except BadInput:
        pass  # it knows light from the viewer's side only
    else:
        looks = queries.take(slice(None, None, DIRECTIONS))
        straight = Fallback(method, ("behind",)).transparency(fabric, looks).astype(np.float64)
        figures.append((coloured + behind @ colours(fabric, transmitted=True)).max(axis=1) + straight)
    subject = Record(method=method.name, setting=method.setting, fabric=fabric.name, scene="queries")
    names = ("diffuse", "specular", "colour", "all")
    return [subject.of(f"furnace_{n}", float(x.max()), len(x)) for n, x in zip(names, figures, strict=False)]


def _energy(method: Method, fabric: Fabric, queries: Queries) -> Float64:
    """Return the share of an even sky that each component of a patch returns, (N, 4)."""
    values = method.predict(fabric, queries, 0).astype(np.float64)
    return np.asarray(2.0 * math.pi * values.reshape(-1, DIRECTIONS, 4).mean(axis=1))
