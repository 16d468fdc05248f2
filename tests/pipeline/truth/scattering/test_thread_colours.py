import math

import numpy as np
import pytest

from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.thread_colours import component_colours
from tests.pipeline.truth.cloths import PALETTE, coloured, fixed
from weaves.fabric import load_fabric
from weaves.surface import surface_at

EXACT = TruthOptions(relative_error=0.002, max_count=65536)


def queries(u, v, sigma, wi, wo=(0.0, 0.0, 1.0)):
    wi, wo = (np.tile(np.divide(w, np.linalg.norm(w)), (len(u), 1)) for w in (wi, wo))
    return Queries.round(u, v, np.full(len(u), sigma), wi, wo)


def test_colours_of_threads_add_up_and_one_thread_or_no_order_has_its_own():
    fabric = coloured("denim", ends=[["red", 3], ["blue", 5]])
    picks = fabric.weave.warp_over[:, 1].argmax() + 0.5  # ends 1, 5 and 9 are on top there
    found = component_colours(fabric, queries([1.5, 5.5, 9.5], [picks] * 3, 0.02, (0.3, 0.2, 0.93)), EXACT, 1)
    red, blue = ([PALETTE[name]["diffuse"]] for name in ("red", "blue"))
    assert found.mean[:, 2] == pytest.approx(np.concatenate([red, blue, red]))
    assert found.mean[0, 0] == pytest.approx(PALETTE["red"]["specular"])
    assert found.mean[1, 0] == pytest.approx(fabric.warp.specular_rgb)
    denim = load_fabric("denim")
    behind = queries([0.3], [2.2], 1.4, (0.0, 0.6, -0.8))
    found = component_colours(denim, behind, EXACT, 1)
    names, yarns = ("specular_rgb", "diffuse_transmission_rgb"), (denim.warp, denim.weft)
    assert found.mean[0].tolist() == [list(getattr(yarn, name)) for name in names for yarn in yarns]
    assert (found.standard_error == 0).all()
    # The same points weigh both, so that the sum is exact whatever the noise.
    runs = [["red", 2], ["blue", 1], ["red", 1], ["blue", 3]]
    exchanged = [["blue" if name == "red" else "red", count] for name, count in runs]
    asked = queries([0.3, 2.2, 5.0], [0.1, 1.2, 2.9], 1.1, (0.5, -0.3, 0.81), (-0.6, 0.0, 0.8))
    first, second = (
        component_colours(coloured("denim", ends=chosen, picks=chosen), asked, TruthOptions(max_count=4096), 1).mean
        for chosen in (runs, exchanged)
    )
    both = np.add(PALETTE["red"]["diffuse"], PALETTE["blue"]["diffuse"])
    assert (first + second)[:, 2:] == pytest.approx(np.broadcast_to(both, (3, 2, 3)), abs=1e-12)


def test_diffuse_colours_are_those_of_an_integral_on_a_lattice():
    """Viewer and light straight above, where nothing hides anything.

    A diffuse share is w_d n_z + 1 - w_d on the area in the plane."""
    fabric = coloured("gauze", ends=[["red", 3], ["blue", 2]], picks=[["blue", 1], ["red", 1]])
    asked = queries([0.4, 2.9], [1.3, 0.2], 0.7, (0.0, 0.0, 1.0))
    asked = asked._replace(sigma_minor=np.float32([0.25, 0.25]), angle=np.float32([0.6, 0.6]))
    options = TruthOptions(relative_error=0.001, max_count=2**18)
    found = component_colours(fabric, asked, options, 1)
    step = (np.arange(450) + 0.5) / 450 * 9.0 - 4.5
    for row in range(2):
        x, y = asked.u[row] + step[None, :], asked.v[row] + step[:, None]
        turn = float(asked.angle[row])
        along = (x - asked.u[row]) * math.cos(turn) + (y - asked.v[row]) * math.sin(turn)
        across = (y - asked.v[row]) * math.cos(turn) - (x - asked.u[row]) * math.sin(turn)
        mass = np.exp(-0.5 * (along / 0.7) ** 2 - 0.5 * (across / 0.25) ** 2)
        seen = surface_at(fabric, *np.broadcast_arrays(x, y))
        threads = np.floor(x).astype(int), np.floor(y).astype(int)
        for family, (colours, thread) in enumerate(zip(fabric.thread_colours(), threads, strict=True)):
            yarn = (fabric.warp, fabric.weft)[family]
            weight = mass * (seen.yarn == family) * (yarn.blend * seen.normal[..., 2] + 1 - yarn.blend)
            diffuse = colours.diffuse[np.broadcast_to(thread, weight.shape) % len(colours.diffuse)]
            expected = (weight[..., None] * diffuse).sum(axis=(0, 1)) / weight.sum()
            assert found.mean[row, 2 + family] == pytest.approx(expected, abs=0.004)


def test_standard_errors_are_those_of_independent_repetitions():
    fabric = coloured("denim", ends=[["red", 2], ["blue", 1]], picks=[["blue", 1], ["red", 3]])
    asked = queries([0.3], [2.2], 1.4, (0.5, -0.3, 0.81), (-0.6, 0.0, 0.8))
    many = Queries(*(np.repeat(column, 200, axis=0) for column in asked))
    found = component_colours(fabric, many, fixed(256, "auto"), 7)
    # With fixed components, the patch's colour scatters as the colours do.
    components = estimate(fabric, asked, TruthOptions(relative_error=0.002), 3).mean[0].astype(float)
    patch = np.einsum("j,njc->nc", components, found.mean)
    ratio = patch.std(axis=0, ddof=1) / np.sqrt(np.square(found.standard_error).mean(axis=0))
    assert np.all((ratio > 0.7) & (ratio < 1.4)), ratio
