import numpy as np
from scipy import stats

from pipeline.compiled.decorators import allocating_kernel
from pipeline.truth.footprint.sequences import derive, mix, owen_pair, uniform

LEVEL = 1e-4


@allocating_kernel
def _pairs(key, count):
    points = np.empty((count, 2))
    for k in range(count):
        points[k] = owen_pair(key, k)
    return points


@allocating_kernel
def _uniforms(key, count, dimension):
    numbers = np.empty(count)
    for k in range(count):
        numbers[k] = uniform(key, k, dimension)
    return numbers


def test_sequences_are_those_published_uniform_in_pairs_and_nets_in_every_aligned_run():
    # The first outputs of SplitMix64 seeded with 0, as its authors publish them.
    weyl = 0x9E3779B97F4A7C15
    outputs = [int(mix(np.uint64((n * weyl) % 2**64))) for n in (1, 2, 3)]
    assert outputs == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]
    key = np.uint64(derive(np.uint64(7), 3))
    first, second = _uniforms(key, 200_000, 0), _uniforms(key, 200_000, 1)
    for a, b in ((first, second), (first[:-1], first[1:])):
        counts = np.histogram2d(a, b, bins=32, range=((0, 1), (0, 1)))[0]
        assert stats.chisquare(counts.ravel()).pvalue > LEVEL
    for m in range(1, 11):
        # (0, m, 2)-net: every dyadic box of area 2^-m holds exactly one point.
        points = _pairs(np.uint64(derive(np.uint64(11), m)), 3 * 2**m)
        for start in (0, 2**m, 2 ** (m + 1)):
            run = points[start : start + 2**m]
            for a in range(m + 1):
                box = (run[:, 0] * 2**a).astype(int) * 2 ** (m - a) + (run[:, 1] * 2 ** (m - a)).astype(int)
                assert len(set(box)) == 2**m
    # Unbiasedness: one fixed index, many keys, both coordinates jointly uniform.
    points = np.array([owen_pair(np.uint64(derive(np.uint64(5), k)), 37) for k in range(40_000)])
    counts = np.histogram2d(*points.T, bins=16, range=((0, 1), (0, 1)))[0]
    assert stats.chisquare(counts.ravel()).pvalue > LEVEL
    assert points.min() > 0.0 and points.max() < 1.0
