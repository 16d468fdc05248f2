"""Errors of an encoder of angular samples by what it is given: the experiments of [Rainer2020Unified].

A block of texels of one fabric is seen under directions drawn at random; the last `_TEST` pairs of directions are held
out, and errors are the relative RMSE of the colour measure (`reports.error`) under them, over all texels:

    random samples           by their number
    as many lights as views  every light with every view, evenly over the projected disc, by their number
    noise                    by the relative standard deviation of a number of random samples
    interpolation            of the samples themselves, without a network, by their number: the mean of the `_NEAREST`
                             samples whose directions are nearest, weighted by the inverse of their squared distance
    averaged latents         of squares of texels, by their side; for comparison, latents of averaged samples
    blended latents          of two fabrics, by the share of the second; for comparison, latents of blended samples
"""

from typing import Any, Final, Protocol

import numpy as np
from scipy.spatial import KDTree

from pipeline.compiled.arrays import Float32
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Answers, Queries
from reports.error import COLOUR_WEIGHTS, colour_error
from reports.measure.latents import SHARES
from reports.record import Record
from weaves.fabric import Fabric

GIVEN: Final = (5, 10, 20, 50, 100, 200, 500)
"""Numbers of samples of a texel."""

_LIGHTS: Final = (3, 4, 7, 10)  # numbers of lights, and of views, of a regular set of samples
_NOISES: Final = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0)  # relative standard deviations of samples
_TEST: Final = 96  # pairs of directions held out
_NOISY: Final = 100  # samples that noise is added to
_NEAREST: Final = 4
_CELLS: Final = 2  # yarns along each side of the block
_SEED: Final = 41

Curves = dict[str, list[tuple[float, float]]]  # errors, by the way of encoding and what the way is by


class TexelEncoder(Protocol):
    """An encoder of samples, and a decoder of latents; `options` are those of `unified_btf`."""

    name: str
    options: Any

    def encode(self, wi: Float32, wo: Float32, values: Float32) -> Float32:
        """Return latents (T, numbers) of components (n, T, 4) under n pairs of directions, (n, 3) each."""

    def decode(self, latents: Float32, wi: Float32, wo: Float32) -> Float32:
        """Return the components (n, T, 4) of latents under n pairs of directions."""


class _Block:
    """A block of texels of a fabric under random pairs of directions: those to encode, then those held out."""

    def __init__(self, encoder: TexelEncoder, fabric: Fabric, truth: TruthOptions) -> None:
        self.fabric, self.encoder, self.options, self._truth = fabric, encoder, encoder.options, truth
        self.side = _CELLS * self.options.texels_per_yarn
        drawn = draw_queries(QueryOptions(max_angle=self.options.max_angle), (1, 1), _SEED, 0, GIVEN[-1] + _TEST)
        self.wi, self.wo = drawn.wi[: GIVEN[-1]], drawn.wo[: GIVEN[-1]]
        self._tested = drawn.wi[GIVEN[-1] :], drawn.wo[GIVEN[-1] :]
        values, errors = self.seen(drawn.wi, drawn.wo)
        self.values, self.held_out = values[: GIVEN[-1]], (values[GIVEN[-1] :], errors[GIVEN[-1] :])

    def seen(self, wi: Float32, wo: Float32) -> tuple[Float32, Float32]:
        """Return the truth and its errors of all texels under n pairs of directions, (n, T, 4) each."""
        fine, rows = self.options.texels_per_yarn, len(wi) * self.side**2
        places = np.divmod(np.tile(np.arange(self.side**2), len(wi)), self.side)
        v, u = (((place + 0.5) / fine).astype(np.float32) for place in places)
        directions = (np.repeat(part, self.side**2, axis=0) for part in (wi, wo))
        queries = Queries.round(u, v, np.full(rows, self.options.texel_sigma / fine, np.float32), *directions)
        answers = estimate(self.fabric, queries, self._truth, _SEED)
        mean, error = (part.reshape(len(wi), -1, 4) for part in (answers.mean, answers.standard_error))
        return mean, error

    def encoded(self, values: Float32) -> Float32:
        """Return the latents of values under the first directions to encode."""
        return self.encoder.encode(self.wi[: len(values)], self.wo[: len(values)], values)

    def error(self, latents: Float32) -> float:
        """Return the error of latents of all texels under the directions held out."""
        return relative_error(self.answers(latents), *self.held_out)

    def answers(self, latents: Float32) -> Float32:
        """Return the components of latents under the directions held out."""
        return self.encoder.decode(latents, *self._tested)

    def interpolated(self, count: int) -> Float32:
        """Return the components under the directions held out that the nearest of `count` samples give."""
        given, tested = (
            np.concatenate([w[:, :2] for w in pair], axis=1) for pair in ((self.wi, self.wo), self._tested)
        )
        distance, nearest = KDTree(given[:count]).query(tested, k=min(_NEAREST, count))
        weights = 1.0 / np.maximum(distance**2, 1e-12)
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(np.einsum("nk,nktc->ntc", weights, self.values[nearest]), np.float32)


def measure_encodings(encoder: TexelEncoder, fabric: Fabric, other: Fabric, truth: TruthOptions) -> list[Record]:
    """Return Records of `encoding_error`, one a way to encode: the note names it, the curve has the errors.

    The value is the last error of a curve. `other` is the fabric that latents are blended with.
    """
    block, second = (_Block(encoder, cloth, truth) for cloth in (fabric, other))
    curves = _by_samples(block) | _by_level(block) | _by_share(block, second)
    subject = Record(method=encoder.name, fabric=fabric.name)
    return [
        subject.model_copy(update={"note": way}).of(
            "encoding_error", points[-1][1], _TEST * block.side**2, curve=points
        )
        for way, points in curves.items()
    ]


def _by_samples(block: _Block) -> Curves:
    """Return errors by number, pattern and noise of samples, and of their interpolation."""
    noisy, random = block.values[:_NOISY], np.random.default_rng(_SEED)
    drawn = random.standard_normal(noisy.shape, np.float32)
    grids: list[tuple[float, float]] = []
    for count in _LIGHTS:
        lights, views = (evenly(count, block.options.max_angle, turn) for turn in (0.0, 0.5))
        pairs = np.repeat(lights, count, axis=0), np.tile(views, (count, 1))
        latents = block.encoder.encode(*pairs, block.seen(*pairs)[0])
        grids.append((count**2, block.error(latents)))
    return {
        "random samples": [(count, block.error(block.encoded(block.values[:count]))) for count in GIVEN],
        "interpolation of samples": [
            (count, relative_error(block.interpolated(count), *block.held_out)) for count in GIVEN
        ],
        "as many lights as views": grids,
        f"noise of {_NOISY} samples": [
            (noise, block.error(block.encoded(np.maximum(noisy * (1.0 + np.float32(noise) * drawn), 0.0))))
            for noise in _NOISES
        ],
    }


def _by_level(block: _Block) -> Curves:
    """Return errors of averaged latents, and of latents of averaged samples, by texels along a side of a mean."""
    latents, curves, width = block.encoded(block.values), Curves(), 1
    while width <= block.side:
        truth, variance = (averaged(part, width) for part in (block.held_out[0], block.held_out[1] ** 2))
        error = (variance**0.5 / width).astype(np.float32)
        ways = {
            "averaged latents": averaged(latents[None], width)[0],
            "latents of averaged samples": block.encoded(averaged(block.values, width)),
        }
        for way, encoded in ways.items():
            curves.setdefault(way, []).append((width, relative_error(block.answers(encoded), truth, error)))
        width *= 2
    return curves


def _by_share(block: _Block, second: _Block) -> Curves:
    """Return errors of blended latents, and of latents of blended samples, by the share of the second fabric."""
    start, end = block.encoded(block.values), block.encoded(second.values)
    name, curves = second.fabric.name, Curves()
    for share in map(np.float32, SHARES):
        kept = 1 - share
        truth, error = (
            part * kept + other * share for part, other in zip(block.held_out, second.held_out, strict=True)
        )
        ways = {
            f"latents blended with those of {name}": kept * start + share * end,
            f"latents of samples blended with {name}": block.encoded(kept * block.values + share * second.values),
        }
        for way, latents in ways.items():
            curves.setdefault(way, []).append((float(share), relative_error(block.answers(latents), truth, error)))
    return curves


def averaged(values: Float32, width: int) -> Float32:
    """Return texels (n, T, numbers) of a square block, averaged over squares of a width."""
    count, texels, numbers = values.shape
    side = round(texels**0.5) // width
    means: Float32 = values.reshape(count, side, width, side, width, numbers).mean(axis=(2, 4))
    return means.reshape(count, side * side, numbers)


def relative_error(values: Float32, truth: Float32, error: Float32) -> float:
    """Return the relative RMSE of the colour measure of components (n, T, 4), noise of the truth subtracted."""
    values, truth, error = (part.reshape(-1, 4) for part in (values, truth, error))
    answers = Answers.opaque(truth, error, np.ones(len(truth), np.int32))
    return colour_error(values, answers, COLOUR_WEIGHTS, resamples=0).relative_rmse


def evenly(count: int, max_angle: float, turn: float) -> Float32:
    """Return unit vectors evenly over the projected disc, (count, 3), by a spiral of golden angles [Vogel1979Head]."""
    index = np.arange(count) + 0.5
    radius, azimuth = (
        np.sin(np.radians(max_angle)) * np.sqrt(index / count),
        np.pi * (3.0 - np.sqrt(5.0)) * index + turn,
    )
    level = radius * np.cos(azimuth), radius * np.sin(azimuth)
    return np.stack([*level, np.sqrt(1.0 - radius**2)], axis=-1).astype(np.float32)
