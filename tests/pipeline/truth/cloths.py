"""Cloths and queries of many tests: woven ones, one without symmetries, one whose answers are known."""

import math

import numpy as np

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.draft import Draft, Matrix
from weaves.fabric import Fabric, load_fabric


def woven(name, rows=None, warp=(), weft=(), **changes):
    """Return a preset with another draft and with other numbers of its yarns, `changes` of both families."""
    fabric, own = load_fabric(name), {"warp": dict(warp), "weft": dict(weft)}
    yarns = {family: getattr(fabric, family).model_copy(update=changes | own[family]) for family in own}
    return fabric.model_copy(update=yarns | ({"draft": Matrix(rows=tuple(rows))} if rows else {}))


def irregular(side, seed, **changes):
    """Return a square draft that chance has drawn, with changes of the yarns of both families."""
    over = np.random.default_rng(seed).random((side, side)) < 0.5
    return woven("polyester_lining", Draft(over[::-1]).rows(), **changes)


CORDUROY = woven("denim", ("#",))
"""Warps alone: straight half cylinders of radius 1/2 side by side, for closed forms."""

PALETTE = {"red": {"diffuse": [0.6, 0.1, 0.2], "specular": [0.4, 0.2, 0.1]}, "blue": {"diffuse": [0.1, 0.2, 0.5]}}


def coloured(cloth, **order):
    """Return a cloth, or a preset, with an order of red and blue threads."""
    fabric = load_fabric(cloth) if isinstance(cloth, str) else cloth
    return Fabric.model_validate(fabric.model_dump() | {"colours": {"palette": PALETTE} | order})


def equal_queries(wi, wo, sigma=2.0, rows=1, centre=(0.3, 0.7)):
    """Return equal queries about one round footprint."""
    ones = np.ones(rows, np.float32)
    directions = (np.tile(np.asarray(w, np.float32), (rows, 1)) for w in (wi, wo))
    return Queries.round(ones * centre[0], ones * centre[1], (ones * sigma).astype(np.float32), *directions)


def drawn(fabric, seed, rows, **options):
    """Return random queries about a fabric."""
    return draw_queries(QueryOptions(**options), fabric.repeat, seed, 0, rows)


def answering(estimator, **options):
    """Return options of an estimator; `quadrature`, which knows no rims, leaves walls out."""
    walls = {"walls": "left_out"} if estimator == "quadrature" else {}
    return TruthOptions(estimator=estimator, **walls | options)


def fixed(count, estimator="owen", **options):
    """Return options that spend this number of points on each query."""
    limits = {"relative_error": 1e-9, "absolute_error": 0.0, "min_count": count, "max_count": count}
    return answering(estimator, **limits | options)


LOPSIDED = woven("denim", ("#.#", "##.", ".##"), {"width": 0.8, "twist": 20.0}, {"bend": 35.0, "relief": 1.2})
"""Without symmetries of its own: yarns unlike, with gaps."""

OVER = LOPSIDED.weave.warp_over


def redrawn(over, swap=False, mirrored=False):
    """Return `LOPSIDED` with another draft, its families exchanged if `swap`, its twists reversed if `mirrored`."""
    sign = -1.0 if mirrored else 1.0
    warp, weft = (yarn.model_copy(update={"twist": sign * yarn.twist}) for yarn in (LOPSIDED.warp, LOPSIDED.weft))
    yarns = {"warp": weft, "weft": warp} if swap else {"warp": warp, "weft": weft}
    return LOPSIDED.model_copy(update=yarns | {"draft": Matrix(rows=tuple(Draft(over).rows()))})


def reversed_axes(queries, x, y, repeat=LOPSIDED.weave.repeat):
    """Return queries with x, y or both reversed."""
    signs = np.float32([x, y, 1.0])
    u = queries.u if x > 0 else repeat[0] - queries.u
    v = queries.v if y > 0 else repeat[1] - queries.v
    return queries._replace(u=u, v=v, wi=queries.wi * signs, wo=queries.wo * signs, angle=x * y * queries.angle)


def exchanged_axes(queries):
    """Return queries with x and y exchanged: a mirror in the diagonal."""
    order, angle = [1, 0, 2], np.float32(np.pi / 2) - queries.angle
    return queries._replace(
        u=queries.v, v=queries.u, wi=queries.wi[:, order], wo=queries.wo[:, order], angle=angle
    )  # fmt: skip


IMAGES = {
    "half a turn": lambda q: (redrawn(OVER[::-1, ::-1]), reversed_axes(q, -1, -1)),
    "mirror": lambda q: (redrawn(OVER[:, ::-1], mirrored=True), reversed_axes(q, -1, 1)),
    "exchange": lambda q: (redrawn(~OVER.T, swap=True, mirrored=True), exchanged_axes(q)),
    "begun elsewhere": lambda q: (redrawn(np.roll(OVER, (-2, -1), (0, 1))), q._replace(u=q.u - ONE, v=q.v - ONE - ONE)),
    "drawn twice": lambda q: (redrawn(np.tile(OVER, (1, 2))), q),
}
"""`LOPSIDED` and queries about it, drawn in another way: answers are the same, those of warp and weft exchanged."""

ONE = np.float32(1)


def on_lattice(queries):
    """Return queries whose centres lie on a lattice of 1/64, so that single precision moves them exactly."""
    return queries._replace(u=np.round(queries.u * 64) / 64, v=np.round(queries.v * 64) / 64)


def agree(one, other, worst, mean):
    """Compare answers (N, K): no difference, over the largest one of its column, is `worst`, nor their mean `mean`."""
    difference = np.abs(one - other) / one.max(axis=0)
    assert one.max(axis=0).min() > 0.01 and difference.max() < worst, difference.max(axis=0)
    assert difference.mean() < mean


def images_agree(method, queries, worst, mean, without=()):
    """Compare a method's answers (N, K) about all `IMAGES` but those `without`. A mirror reverses the sense of the
    twists: without that the mirrored cloth answers otherwise."""
    queries = on_lattice(queries)
    own = method(LOPSIDED, queries)
    for image, draw in IMAGES.items():
        if image not in without:
            there = method(*draw(queries))
            order = [1, 0, 3, 2, *range(4, there.shape[1])] if image == "exchange" else slice(None)
            agree(own, there[:, order], worst, mean)
    wrong = method(redrawn(OVER[:, ::-1]), reversed_axes(queries, -1, 1))
    assert np.abs(own - wrong).max() > 0.01 * own.max()


def moved_far(queries):
    """Return queries on the lattice, and the same 1,024 and 2,048 repeats of `LOPSIDED` away."""
    near, (ends, picks) = on_lattice(queries), np.float32(LOPSIDED.weave.repeat)
    return near, near._replace(u=near.u + np.float32(1024) * ends, v=near.v - np.float32(2048) * picks)


def cylinders(**changes):
    """Return round warps side by side that never bend: cylinders of diameter 1 at distance 1."""
    return woven("denim", ("##", "##"), width=1.0, relief=1.0, **changes)


def along_cylinders(count=40, most=1.4, viewer=0.0, seed=2):
    """Return wide queries, the light anywhere, the viewers up to an angle along the yarns, which hides nothing."""
    random = np.random.default_rng(seed)
    theta, phi = random.uniform(0.0, most, count), random.uniform(0.0, 2.0 * math.pi, count)
    wi = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    tilt = random.uniform(-viewer, viewer, count)
    wo = np.stack([np.zeros(count), np.sin(tilt), np.cos(tilt)], axis=1)
    return Queries.round(random.random(count) * 2, random.random(count) * 2, np.full(count, 8.0), wi, wo)


def cylinder_answers(fabric, queries):
    """Return specular and diffuse component and transparency of `cylinders`, (N, 3), by integrals over the angle v.
    Across the yarns the light has the angle t to the normal. It meets a yarn from v = t - pi/2, where its surface turns
    away, to where the neighbour's shadow begins: sin(v - t) = 2 cos t - 1. Formulas as printed [Wang2022SpongeCake]."""
    yarn, depth = fabric.warp, fabric.optical_thickness
    wi, wo = (w.astype(np.float64) for w in (queries.wi, queries.wo))
    side, t = np.where(wi[:, 0] < 0.0, -1.0, 1.0), np.arctan2(np.abs(wi[:, 0]), wi[:, 2])
    lit = t - math.pi / 2, np.minimum(t + np.arcsin(2.0 * np.cos(t) - 1.0), math.pi / 2)
    nodes, weights = np.polynomial.legendre.leggauss(200)

    def frame(low, high):
        half, middle = 0.5 * (high - low), 0.5 * (high + low)
        v, twist = side[:, None] * (middle[:, None] + half[:, None] * nodes), math.radians(yarn.twist)
        zero = np.zeros_like(v)
        normal = np.stack([np.sin(v), zero, np.cos(v)], -1)
        fibre = np.stack([-np.cos(v) * math.sin(twist), zero + math.cos(twist), np.sin(v) * math.sin(twist)], -1)
        return normal, fibre, 0.5 * half[:, None] * weights * np.cos(v)

    def sigma(w, fibre):
        return np.sqrt(1.0 - (1.0 - yarn.roughness**2) * np.einsum("nvc,nc->nv", fibre, w) ** 2)

    normal, fibre, share = frame(*lit)
    cos_i, cos_o = (np.einsum("nvc,nc->nv", normal, w) for w in (wi, wo))
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    q = 1.0 - np.einsum("nvc,nc->nv", fibre, half) ** 2 * (1.0 - yarn.roughness**-2)
    s_i, s_o = sigma(wi, fibre), sigma(wo, fibre)
    crossed = 1.0 - np.exp(-depth * (s_i / cos_i + s_o / cos_o))
    specular = cos_i * crossed / (math.pi * yarn.roughness * q**2) / (4.0 * (s_i * cos_o + s_o * cos_i))
    diffuse = (yarn.blend * cos_i + (1.0 - yarn.blend) * wi[:, 2:]) / math.pi
    whole, straight, everywhere = frame(np.full_like(t, -math.pi / 2), np.full_like(t, math.pi / 2))
    through = np.exp(-depth * sigma(wo, straight) / np.einsum("nvc,nc->nv", whole, wo)) * everywhere
    return np.stack([(specular * share).sum(1), (diffuse * share).sum(1), through.sum(1)], axis=1)
