"""Random and low-discrepancy numbers as pure functions of (key, index, dimension).

There is no state: any worker, in any order, computes the same number from the same key, index and dimension. The
generator is SplitMix64's finaliser over a Weyl sequence [Steele2014SplitMix]. Points in the unit square: independent;
R2, the additive sequence of the plastic number with a random shift [Roberts2018R2]; and the first two Sobol dimensions
[Sobol1967] with nested uniform (Owen) scrambling by the Laine-Karras hash in Vegdahl's constants [Burley2020Owen].
"""

import math

import numpy as np

from pipeline.compiled.decorators import kernel

_LEAST = 2.0**-54  # what a coordinate of 0 becomes, for the quantiles of unbounded kernels
_WEYL = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_11, _27, _30, _31, _32 = (np.uint64(bits) for bits in (11, 27, 30, 31, 32))


@kernel
def mix(value: np.uint64) -> np.uint64:
    """Scramble 64 bits: SplitMix64's finaliser, a bijection."""
    value = (value ^ (value >> _30)) * _MIX_1
    value = (value ^ (value >> _27)) * _MIX_2
    return value ^ (value >> _31)


@kernel
def derive(key: np.uint64, index: int) -> np.uint64:
    """Return the key of the `index`-th stream below `key`."""
    return mix(key + _WEYL * (np.uint64(index) + np.uint64(1)))


@kernel
def uniform(key: np.uint64, index: int, dimension: int) -> float:
    """Return the random number in [0, 1) named (key, index, dimension)."""
    return float(derive(derive(key, dimension), index) >> _11) * 2.0**-53


@kernel
def _reverse_bits(x: np.uint32) -> np.uint32:
    x = ((x >> np.uint32(1)) & np.uint32(0x55555555)) | ((x & np.uint32(0x55555555)) << np.uint32(1))
    x = ((x >> np.uint32(2)) & np.uint32(0x33333333)) | ((x & np.uint32(0x33333333)) << np.uint32(2))
    x = ((x >> np.uint32(4)) & np.uint32(0x0F0F0F0F)) | ((x & np.uint32(0x0F0F0F0F)) << np.uint32(4))
    x = ((x >> np.uint32(8)) & np.uint32(0x00FF00FF)) | ((x & np.uint32(0x00FF00FF)) << np.uint32(8))
    return np.uint32((x >> np.uint32(16)) | (x << np.uint32(16)))


@kernel
def _scramble_reversed(x: np.uint32, seed: np.uint32) -> np.uint32:
    """Owen-scramble a number whose bits are reversed: every bit is flipped by a hash of the bits below it."""
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x3D20ADEA)))
    x = np.uint32(x + seed)
    x = np.uint32(x * np.uint32((seed >> np.uint32(16)) | np.uint32(1)))
    x = np.uint32(x ^ np.uint32(x * np.uint32(0x05526C56)))
    return np.uint32(x ^ np.uint32(x * np.uint32(0x53A22864)))


@kernel
def _sobol_second_reversed(x: np.uint32) -> np.uint32:
    """Return the second Sobol coordinate, bits reversed: its matrix is the fifth tensor power of [[1, 1], [0, 1]]."""
    x ^= (x >> np.uint32(16)) & np.uint32(0x0000FFFF)
    x ^= (x >> np.uint32(8)) & np.uint32(0x00FF00FF)
    x ^= (x >> np.uint32(4)) & np.uint32(0x0F0F0F0F)
    x ^= (x >> np.uint32(2)) & np.uint32(0x33333333)
    x ^= (x >> np.uint32(1)) & np.uint32(0x55555555)
    return np.uint32(x)


@kernel
def owen_pair(key: np.uint64, index: int) -> tuple[float, float]:
    """Return the `index`-th point in (0, 1)^2 of the Owen-scrambled Sobol sequence that `key` names.

    Any aligned run of 2^m indices is a (0, m, 2)-net; different keys are independent randomisations, so the mean over
    keys is unbiased.
    """
    # Reversed, the first coordinate is the index itself; scrambling works on reversed bits.
    first = _reverse_bits(_scramble_reversed(np.uint32(index), np.uint32(key >> _32)))
    seed = np.uint32(key & np.uint64(0xFFFFFFFF))
    second = _reverse_bits(_scramble_reversed(_sobol_second_reversed(np.uint32(index)), seed))
    return (float(first) + 0.5) * 2.0**-32, (float(second) + 0.5) * 2.0**-32


_PLASTIC = 1.32471795724474602596
_R2_FIRST, _R2_SECOND = 1.0 / _PLASTIC, 1.0 / (_PLASTIC * _PLASTIC)


@kernel
def r2_pair(key: np.uint64, index: int) -> tuple[float, float]:
    """Return the `index`-th point in (0, 1)^2 of the R2 sequence, shifted by the random vector that `key` names."""
    first = uniform(key, 0, 0) + index * _R2_FIRST
    second = uniform(key, 0, 1) + index * _R2_SECOND
    return max(first - math.floor(first), _LEAST), max(second - math.floor(second), _LEAST)


@kernel
def independent_pair(key: np.uint64, index: int) -> tuple[float, float]:
    """Return the `index`-th of independent random points in (0, 1)^2."""
    return max(uniform(key, index, 0), _LEAST), max(uniform(key, index, 1), _LEAST)
