import math
import os
import subprocess
import sys

import numpy as np
import pytest

from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.pipeline.truth.cloths import LOPSIDED, drawn, fixed
from tests.presets import slow
from weaves.errors import BadInput
from weaves.fabric import load_fabric


def test_curved_cloth_is_refused_and_left_to_other_estimators():
    fabric = load_fabric("denim")
    queries = drawn(fabric, 3, 4, sigma=(1.0, 8.0), max_angle=60.0)
    curved = queries._replace(curvature=np.float32([0, 0, 0.1, 0]))
    with pytest.raises(BadInput, match=r"node_table \(row 2\).*take auto"):
        estimate(fabric, curved, TruthOptions(estimator="node_table"), 0)
    assert np.isfinite(estimate(fabric, curved, TruthOptions(), 0).mean).all()


@pytest.mark.parametrize(
    ("fabric", "behind"),
    [
        pytest.param(LOPSIDED, False, id="narrow"),
        pytest.param(load_fabric("denim"), True, id="twill_behind"),
        pytest.param(load_fabric("satin_8"), False, id="satin", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize(
    "choices", [({}, {"parallax": False}), slow(({"parallax": False, "footprint": "box"},))], ids=["gaussian", "box"]
)
def test_answers_match_converged_ones(fabric, behind, choices):
    """Mean signed error of each component below .3 %, within three standard errors of the mean over the queries. The
    typical query is within .6 %; transparency likewise. Footprints of the fabric plane are narrower."""
    for options in choices:
        least = 0.4 if options else 1.5
        queries = drawn(fabric, 21, 80, sigma=(least, 8.0), max_angle=80.0)
        if behind:
            queries = queries._replace(wi=queries.wi * np.float32([1, 1, -1]))
        exact = estimate(fabric, queries, fixed(1 << 15, **options), 4)
        answers = estimate(fabric, queries, TruthOptions(estimator="node_table", **options), 4)
        errors = (answers.mean.astype(np.float64) - exact.mean) / exact.mean.mean(axis=0)
        bias, spread = errors.mean(axis=0), errors.std(axis=0, ddof=1) / math.sqrt(len(errors))
        assert (np.abs(bias) < 0.003 + 3 * spread).all(), (options, bias, spread)
        size = np.linalg.norm(exact.mean, axis=1)
        assert np.median(np.linalg.norm(answers.mean - exact.mean, axis=1) / size) < (0.012 if behind else 0.006)
        assert np.median(np.abs(answers.transparency - exact.transparency)) < 1e-3


FENCED = """
import ctypes
import itertools
import mmap
import numpy as np
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry import horizon
from pipeline.truth.node_table.build import tabulate
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric

protect, page = ctypes.CDLL(None).mprotect, mmap.PAGESIZE
protect.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]

def fenced(values):
    # A copy whose last byte is the last one before a page that nobody may touch.
    size = -(-values.nbytes // page) * page
    memory = np.frombuffer(mmap.mmap(-1, size + page), np.uint8)
    assert protect(memory.ctypes.data + size, page, 0) == 0
    own = memory[size - values.nbytes : size].view(values.dtype).reshape(values.shape)
    own[...] = values
    return own

def field(side):
    return type(side)(*(fenced(part) if isinstance(part, np.ndarray) else part for part in side))

for name in ("denim", "voile"):
    cloth = cloth_side(load_fabric(name), TruthOptions())
    front, back = field(cloth.front), field(cloth.back)
    plain = tabulate(cloth.front, cloth.back, True, 6, 8, rims=True)
    horizon._LAST.clear()  # equal arrays would not be read again
    tables = ((*table[:-1], *table.walls) for table in (plain, tabulate(front, back, True, 6, 8, rims=True)))
    assert all(np.array_equal(a, b) for a, b in zip(*tables))
    picks, ends = front.top.shape
    corners = np.array([(x, y) for x in (0.0, np.nextafter(ends, 0.0)) for y in (0.0, np.nextafter(picks, 0.0))])
    x, y = fenced(corners[:, 0]), fenced(corners[:, 1])
    for side, bend in itertools.product((front, back), (0.0, 0.3)):
        assert np.isfinite(horizon.horizons(side, x, y, 8, True, bend)).all()
print("done")
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="pages are protected by mprotect")
def test_the_kernels_of_a_table_stay_within_their_arrays():
    """In a process of its own, which a read beyond an array's end would kill."""
    ended = subprocess.run([sys.executable, "-c", FENCED], env=os.environ, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout.strip()) == (0, "done"), ended.stderr
