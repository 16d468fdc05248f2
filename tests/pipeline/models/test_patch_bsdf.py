import math
from functools import cache

import numpy as np
import pytest
from scipy import stats

from pipeline.analytic.importance.lobes import Lobes
from pipeline.models.named import named_method
from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.truth.query import Queries
from tests.directions import sphere, unit
from tests.pipeline.truth.cloths import equal_queries
from tests.presets import slow
from tests.refusals import refusal
from weaves.colour import LUMINANCE
from weaves.errors import BadInput
from weaves.fabric import load_fabric

LEVEL = 0.01
ROWS, COLUMNS, NODES = 16, 32, 8  # cells in cosine and azimuth; quadrature nodes along each side of a cell
COUNT = 100_000
# Fabric, deviations of the footprint, angle, and the viewer's angle to the normal and azimuth: more than 90 is behind.
CONFIGURATIONS = {
    "front": ("polyester_lining", 0.3, 0.3, 0.0, 30.0, 20.0),
    "along the normal": ("denim", 0.3, 0.3, 0.0, 0.0, 0.0),
    "grazing": ("silk_charmeuse", 0.4, 0.4, 0.0, 80.0, 130.0),
    "wide": ("silk_charmeuse", 30.0, 30.0, 0.0, 40.0, 65.0),
    "tiny": ("polyester_lining", 0.001, 0.001, 0.0, 50.0, 250.0),
    "ellipse": ("wool_gabardine", 0.9, 0.15, 0.7, 60.0, 300.0),
    "voile": ("voile", 1.5, 1.5, 0.0, 20.0, 100.0),
    "gauze": ("gauze", 0.5, 0.3, 1.2, 70.0, 10.0),
    "behind": ("silk_charmeuse", 0.5, 0.5, 0.0, 130.0, 45.0),
    "behind a gauze": ("gauze", 1.0, 1.0, 0.0, 105.0, 200.0),
}


def looks_of(name, count, wi=None):
    _, *numbers, theta, phi = CONFIGURATIONS[name]
    columns = (np.full(count, value, np.float32) for value in (0.62, 0.57, *numbers, 0.0))
    u, v, sigma, sigma_minor, angle, curvature = columns
    wo = np.tile(np.float32(unit(theta, phi)), (count, 1))
    return Queries(u, v, sigma, wo if wi is None else wi.astype(np.float32), wo, sigma_minor, angle, curvature)


@cache
def bsdf_of(name):
    return PatchBSDF(load_fabric(CONFIGURATIONS[name][0]))


def lobes_of(bsdf, name, count):
    return Lobes(*(np.repeat(rows, count, axis=0) for rows in bsdf.lobes(looks_of(name, 1))))


def expected_shares(bsdf, name):
    """Integrate the density over each cell by midpoints: 4 times as many nodes move chi-square by less than .001."""
    wi = sphere(ROWS * NODES, COLUMNS * NODES)
    pdf = bsdf.pdf(looks_of(name, len(wi), wi), lobes_of(bsdf, name, len(wi))).astype(np.float64)
    cell = 4.0 * math.pi / (ROWS * COLUMNS * NODES**2)
    return pdf.reshape(ROWS, NODES, COLUMNS, NODES).sum(axis=(1, 3)) * cell


@pytest.mark.parametrize("names", [("ellipse", "voile", "behind"), slow(*[tuple(CONFIGURATIONS)])])
def test_samples_follow_their_density(names):
    """Chi-square over the cells of the sphere and the delta lobe, those of fewer than 20 expected samples pooled. Sidak
    over the configurations at LEVEL."""
    values = {}
    for number, name in enumerate(names):
        bsdf, looks = bsdf_of(name), looks_of(name, COUNT)
        shares, straight = expected_shares(bsdf, name), float(bsdf.straight(looks.take(slice(1)))[0])
        assert shares.sum() + straight == pytest.approx(1.0, abs=2e-3), name
        sample = bsdf.draw(looks, np.random.default_rng(number).random((COUNT, 3)), lobes_of(bsdf, name, COUNT))
        np.testing.assert_allclose(np.linalg.norm(sample.wi, axis=1), 1.0, atol=1e-6)
        assert (sample.pdf > 0).all()
        wi = sample.wi[~sample.straight].astype(float)
        row = np.minimum(((wi[:, 2] + 1) / 2 * ROWS).astype(int), ROWS - 1)
        column = (np.mod(np.arctan2(wi[:, 1], wi[:, 0]) / (2 * math.pi), 1) * COLUMNS).astype(int) % COLUMNS
        seen = np.append(np.bincount(row * COLUMNS + column, minlength=ROWS * COLUMNS), sample.straight.sum())
        expected = np.append(shares.ravel() * (1.0 - straight) / shares.sum(), straight) * COUNT
        large = expected >= 20
        observed, wanted = (np.append(v[large], v[~large].sum()) for v in (seen, expected))
        if wanted[-1] == 0:
            observed, wanted = observed[:-1], wanted[:-1]
        values[name] = stats.chisquare(observed, wanted).pvalue
    assert min(values.values()) > 1 - (1 - LEVEL) ** (1 / len(values)), values


@pytest.mark.parametrize("name", ["front", slow("voile"), slow("grazing"), slow("ellipse"), slow("behind a gauze")])
def test_weights_have_the_integral_of_eval_as_their_mean(name):
    """A z-test at LEVEL of light that is no longer in the lobes' shares, against even directions, and of light straight
    through."""
    count, wi = 20_000, sphere(80, 160)
    one, every = (PatchBSDF(load_fabric(CONFIGURATIONS[name][0]), bounces=number) for number in (1, "all"))
    queries, looks = looks_of(name, len(wi), wi), looks_of(name, count)
    first, even = (bsdf.eval(queries) @ LUMINANCE for bsdf in (one, every))
    scattered = even.mean() * 4.0 * math.pi
    assert scattered > 1.005 * first.mean() * 4.0 * math.pi
    sample = every.sample(looks, np.random.default_rng(11).random((count, 3)), lobes_of(every, name, count))
    through = float(every.method.transparency(every.fabric, looks.take(slice(1)))[0])
    assert scattered + through <= 1.0
    for own, wanted in ((~sample.straight, scattered), (sample.straight, through)):
        values = np.where(own, sample.weight @ LUMINANCE, 0.0)
        assert abs(values.mean() - wanted) <= stats.norm.isf(0.5 * LEVEL) * values.std() / math.sqrt(count)


@pytest.mark.parametrize("name", ["ellipse", "voile"])
def test_a_sample_is_what_asking_for_it_gives(name):
    bsdf, looks, random = bsdf_of(name), looks_of(name, 500), np.random.default_rng(1).random((500, 3))
    sample = bsdf.sample(looks, random)
    scattered = ~sample.straight
    queries = looks._replace(wi=sample.wi).take(scattered)
    values, pdf = bsdf.eval_pdf(queries)
    np.testing.assert_array_equal(pdf, sample.pdf[scattered])
    np.testing.assert_array_equal(values, bsdf.eval(queries))
    np.testing.assert_allclose(values / pdf[:, None], sample.weight[scattered])
    np.testing.assert_array_equal(sample.wi[sample.straight], -looks.wo[sample.straight])
    for one, other in zip(sample, bsdf.sample(looks, random, bsdf.lobes(looks)), strict=True):
        np.testing.assert_array_equal(one, other)


def test_viewers_on_both_sides_are_answered_together_by_any_method():
    bsdf, random = bsdf_of("behind"), np.random.default_rng(2).random((60, 3))
    looks = looks_of("behind", 60)
    front = np.arange(60) % 3 == 0
    wo = np.where(front[:, None], -looks.wo, looks.wo)
    both = bsdf.sample(looks._replace(wo=wo), random)
    for side in (front, ~front):
        alone = bsdf.sample(looks._replace(wo=wo).take(side), random[side])
        np.testing.assert_array_equal(both.wi[side], alone.wi)
        np.testing.assert_array_equal(both.pdf[side], alone.pdf)
    # Reflected in the fabric plane, a viewer behind sees the front of `Fabric.back()`.
    bsdf, looks = bsdf_of("behind"), looks_of("behind", 200)
    back = PatchBSDF(bsdf.fabric.back())
    wi = np.random.default_rng(3).standard_normal((200, 3))
    queries = looks._replace(wi=(wi / np.linalg.norm(wi, axis=1, keepdims=True)).astype(np.float32))
    np.testing.assert_allclose(bsdf.pdf(queries), back.pdf(queries.turned()), rtol=1e-5)
    np.testing.assert_allclose(bsdf.straight(looks), back.straight(looks.turned()), rtol=1e-6)
    method, looks = named_method("prefiltered", "test", "method"), looks_of("front", 50)
    other, queries = bsdf_of("front"), looks._replace(wi=np.tile(np.float32(unit(20.0, 200.0)), (50, 1)))
    bsdf = PatchBSDF(other.fabric, method)
    np.testing.assert_array_equal(bsdf.pdf(queries), other.pdf(queries))
    assert not np.array_equal(bsdf.eval(queries), other.eval(queries))


@pytest.mark.slow
def test_patches_that_nobody_sees_still_have_samples():
    looks = equal_queries(unit(89.8, 3.0), unit(89.8, 3.0), 0.01, 64, (0.62, 0.57))
    sample = PatchBSDF(load_fabric("voile")).sample(looks, np.random.default_rng(1).random((64, 3)))
    assert np.isfinite(sample.wi).all() and (sample.pdf > 0).all() and np.isfinite(sample.weight).all()


@pytest.mark.parametrize(
    ("random", "message"),
    [
        (np.zeros((3, 3)), "shape of random"),
        ([[0.1, 0.2, 1.0], [0.1, 0.2, 0.3]], r"random\[0, 2\]"),
        ([[0.1, 0.2, 0.3], [-0.1, 0.2, 0.3]], r"random\[1, 0\]"),
        ([[0.1, math.nan, 0.3], [0.1, 0.2, 0.3]], r"random\[0, 1\]"),
        ([[0.1, 0.2, 0.3], [0.1]], "random"),
    ],
)
def test_numbers_that_are_not_in_the_unit_interval_are_refused(random, message):
    with pytest.raises(BadInput, match=message):
        bsdf_of("front").sample(looks_of("front", 2), random)


def test_bad_settings_are_refused():
    bsdf = bsdf_of("front")
    for settings in ({"points": 0}, {"widening": math.nan}, {"method": "no_such_method"}, {"bounces": 2}):
        with pytest.raises(BadInput, match=f"PatchBSDF: {next(iter(settings))}"):
            PatchBSDF(bsdf.fabric, **settings)
    assert "lobes" in refusal(bsdf.pdf, looks_of("front", 3), bsdf.lobes(looks_of("front", 2)))
