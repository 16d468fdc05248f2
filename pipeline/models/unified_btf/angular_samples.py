"""Angular samples of a fabric's texels as arrays: the synthetic bidirectional texture that an encoder reads.

A training reads the samples of its fabrics from shards. A fabric that is added to a trained model brings its samples
with it, as in the paper: computing them is part of the method, and of the time that adding a fabric takes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final
from weakref import WeakValueDictionary

import numpy as np
import numpy.typing as npt

from pipeline.fingerprint import fingerprint
from pipeline.models.unified_btf.options import BtfOptions
from pipeline.shards.store import columns_of
from pipeline.truth.conventions import COMPONENTS
from weaves.fabric import Fabric


@dataclass(frozen=True, eq=False)
class TexelSamples:
    """T texels of one repeat, each seen under the same n pairs of directions.

    Attributes
    ----------
    shape : tuple of int
        Rows and columns of texels; texel t lies in row t // columns, column t % columns.
    wi, wo : float32 (n, 3)
        Directions.
    values : float16 (n, T, 4)
        Components; their own noise is far above the rounding.
    """

    shape: tuple[int, int]
    wi: npt.NDArray[np.float32]
    wo: npt.NDArray[np.float32]
    values: npt.NDArray[np.float16]


_held: Final[WeakValueDictionary[str, TexelSamples]] = WeakValueDictionary()


def read_samples(fabric: Fabric, options: BtfOptions, columns: Mapping[str, npt.NDArray[Any]]) -> TexelSamples:
    """Return a fabric's samples from their columns; as long as they are in use, `angular_samples` finds them."""
    shape = options.angular_samples.grid(fabric)
    texels = shape[0] * shape[1]
    wi, wo = (np.stack([columns[f"{name}_{axis}"][::texels] for axis in "xyz"], axis=-1) for name in ("wi", "wo"))
    values = np.empty((len(wi), texels, 4), np.float16)
    for index, name in enumerate(COMPONENTS):
        values[..., index] = columns[name].reshape(len(wi), texels)
    samples = _held[_key(fabric, options)] = TexelSamples(shape, wi, wo, values)
    return samples


def angular_samples(fabric: Fabric, options: BtfOptions) -> TexelSamples:
    """Return a fabric's samples: those in use in this process, such as a training's, else computed now."""
    samples = _held.get(_key(fabric, options))
    if samples is not None:
        return samples
    wanted = options.angular_samples
    return read_samples(fabric, options, columns_of(*wanted.answer(fabric, 0, wanted.count(fabric))))


def _key(fabric: Fabric, options: BtfOptions) -> str:
    return fingerprint([fabric.optics(), options.angular_samples.model_dump(mode="json")])
