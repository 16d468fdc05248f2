"""The shader as C++ against the Python that it mirrors, from the exported files alone, on every fabric."""

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.features import read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.shader.golden import GROUPS, read_sides, rows_of
from pipeline.shader.tables import QUERY_KINDS, tabulate_sides
from pipeline.truth.query import Queries
from tests.pipeline.shader.conftest import ALLOWED
from tests.presets import PRESETS
from weaves.fabric import load_fabric, preset_names

pytestmark = pytest.mark.external  # slangc and g++

FEW = ("gingham", "polyester_lining")
UNSEEN = ("gauze", "silk_charmeuse", "crepe")


EVERY = "all"


def worst(found, cloth, first=0):
    """Return the largest difference from the golden answers from a column on, as a share of its range in its group."""
    differences = []
    for start, stop in cloth.groups.values():
        expected = cloth.answers[start:stop, first : first + found.shape[1]]
        # What is 0 throughout, as the transparency of a dense cloth, has no range.
        span = np.maximum(np.ptp(expected, axis=0), 1e-12)
        differences.append((np.abs(found[start:stop] - expected) / span).max())
    return max(differences)


def hemisphere(count):
    """Return directions in front, (N, 3), and the solid angle of each: a rule of Gauss in z, even in azimuth."""
    z, weights = np.polynomial.legendre.leggauss(count)
    z, turn = 0.5 + 0.5 * z, 2.0 * np.pi * (np.arange(count) + 0.5) / count
    level = np.sqrt(1.0 - z**2)
    x, y = np.outer(level, np.cos(turn)), np.outer(level, np.sin(turn))
    directions = np.stack([x, y, np.repeat(z[:, None], count, axis=1)], axis=-1).reshape(-1, 3)
    return directions, np.repeat(0.5 * weights * 2.0 * np.pi / count, count)


def check_golden(cpp, cloth, allowed):
    """Check components, bounds, transparency and density of the C++ form against the golden vectors."""
    found = cpp(cloth.buffers, cloth.queries)
    assert worst(found, cloth) < allowed
    assert (found >= 0.0).all() and (found[:, :4] <= found[:, 4:]).all()
    scattered = cpp(cloth.buffers, cloth.queries, "scatter")
    assert worst(scattered[:, [12, 11]], cloth, 8) < allowed
    assert (scattered[:, 12] >= 0.0).all() and (scattered[:, 12] <= 1.0).all()


@pytest.mark.parametrize("name", PRESETS)
def test_golden_vectors_are_answered(cpp, exported, read, name):
    cloth = read(exported(name))
    assert list(cloth.groups) == ["front"]
    check_golden(cpp, cloth, ALLOWED["C++"])


SLOW_BUT_FEW = [name if name in FEW else pytest.param(name, marks=pytest.mark.slow) for name in preset_names()]


@pytest.mark.parametrize("name", SLOW_BUT_FEW)
def test_golden_vectors_of_every_kind_are_answered(cpp, exported, read, name):
    folder = exported(name, kinds=(EVERY,))
    cloth = read(folder)
    assert list(cloth.groups) == list(GROUPS)
    check_golden(cpp, cloth, ALLOWED["C++"])
    check_golden(cpp, read(folder, "float16"), ALLOWED["16 bits"])


@pytest.mark.parametrize("name", PRESETS)
def test_nodes_of_half_precision_answer_to_a_percent(cpp, exported, read, name):
    check_golden(cpp, read(exported(name), "float16"), ALLOWED["16 bits"])


@pytest.mark.parametrize("level", [1, 4, 8])
def test_other_levels_are_answered(cpp, exported, read, level):
    cloth = read(exported("gingham", level))
    check_golden(cpp, cloth, ALLOWED["C++"])


@pytest.mark.parametrize("name", UNSEEN)
def test_queries_that_are_not_golden_are_answered(cpp, exported, read, name):
    """One in 500 may hang on the last digit of a place; of those drawn here, binomially, at most 1 % then do."""
    cloth, rng, count = read(exported(name)), np.random.default_rng(11), 2000
    table = tabulate(load_fabric(name))
    z, turn = rng.uniform(0.02, 1.0, (2, count)), rng.uniform(0.0, 2.0 * np.pi, (2, count))
    level = np.sqrt(1.0 - z**2)
    wi, wo = np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=-1).astype(np.float32)
    sigma = np.exp(rng.uniform(np.log(0.003), np.log(4.0), count))
    u, v = rng.uniform(-300.0, 300.0, (2, count))
    queries = Queries.round(u, v, sigma, wi, wo)
    expected = read_queries(table, queries)
    found = cpp(cloth.buffers, rows_of(queries))
    answers = np.concatenate([expected.components, expected.bounds], axis=1)
    differ = (np.abs(found - answers) / np.ptp(answers, axis=0)).max(axis=1) > ALLOWED["C++"]
    assert differ.mean() < 0.01


@pytest.mark.parametrize("name", UNSEEN)
def test_diffuse_components_make_no_light(cpp, exported, read, name):
    cloth, rng = read(exported(name)), np.random.default_rng(5)
    wi, solid = hemisphere(64)
    for deviation in (0.01, 0.15, 0.4, 5.0):
        wo = hemisphere(8)[0][rng.integers(64)]
        fixed = (*rng.uniform(0.0, 8.0, 2), deviation, 0.7 * deviation, 0.3)
        rows = np.column_stack([np.tile(fixed, (len(wi), 1)), wi, np.tile(wo, (len(wi), 1))])
        found = cpp(cloth.buffers, rows)
        # The rule has 64 x 64 directions: a kink of a clipped cosine costs it some 1e-3.
        assert 0.01 < solid @ found[:, 2:4].sum(axis=1) <= solid @ found[:, 6:8].sum(axis=1) < 1.002
        assert solid @ found[:, 4:6].sum(axis=1) < 0.5


def test_light_and_viewer_behind_answer_nothing_without_their_tables(cpp, exported, read):
    cloth = read(exported("gauze"))
    rows = cloth.queries[:4].copy()
    rows[0, 7], rows[1, 10], rows[2, [7, 10]] = -rows[0, 7], -rows[1, 10], (-rows[2, 7], -rows[2, 10])
    found, scattered = cpp(cloth.buffers, rows), cpp(cloth.buffers, rows, "scatter")
    assert (found[:3] == 0.0).all() and (found[3] > 0.0).any()
    # The transparency depends on no light; lobes of a back that is not known still make a density.
    assert scattered[0, 12] == cpp(cloth.buffers, cloth.queries[:1], "scatter")[0, 12] > 0.0
    assert (scattered[1:3, 12] == 0.0).all() and np.isfinite(scattered).all() and (scattered[:, 3] > 0.0).all()


def test_curvature_counts_as_flat_without_its_tables(cpp, exported, read):
    rows = read(exported("gingham")).queries.copy()
    rows[:, 11] = 0.5
    flat = read(exported("gingham"))
    assert (cpp(flat.buffers, rows) == cpp(flat.buffers, flat.queries)).all()
    curved = read(exported("gingham", kinds=("curvature",)))
    found = np.abs(cpp(curved.buffers, rows) - cpp(flat.buffers, flat.queries)).max(axis=1)
    assert (found > 1e-4).mean() > 0.5


@pytest.mark.parametrize("name", FEW)
def test_queries_of_every_kind_that_are_not_golden_are_answered(cpp, exported, read, name):
    """As of those in front, at most 1 % may hang on the last digit of a place."""
    cloth, rng, count = read(exported(name, kinds=(EVERY,))), np.random.default_rng(12), 600
    sides = tabulate_sides(load_fabric(name), 2, QUERY_KINDS)
    for number, group in enumerate(GROUPS.values()):
        z, turn = rng.uniform(0.02, 1.0, (2, count)), rng.uniform(0.0, 2.0 * np.pi, (2, count))
        level = np.sqrt(1.0 - z**2)
        signed = z * np.array([[group.light], [group.viewer]])
        wi, wo = np.stack([level * np.cos(turn), level * np.sin(turn), signed], axis=-1)
        u, v = rng.uniform(-300.0, 300.0, (2, count))
        sigma, ratio = np.exp(rng.uniform(np.log(0.003), np.log(4.0), count)), rng.uniform(0.2, 1.0, count)
        curvature = rng.uniform(0.0, 1.0, count) if group.curved else np.zeros(count)
        columns = (u, v, sigma, wi, wo, sigma * ratio, rng.uniform(-2.0, 2.0, count), curvature)
        queries = Queries(*(np.asarray(column, np.float32) for column in columns))
        expected = read_sides(sides, queries)
        rows = rows_of(queries)
        found = np.column_stack([cpp(cloth.buffers, rows), cpp(cloth.buffers, rows, "scatter")[:, [12, 11]]])
        span = np.maximum(np.ptp(expected, axis=0), 1e-12)
        differ = (np.abs(found - expected) / span).max(axis=1) > ALLOWED["C++"]
        assert differ.mean() < 0.01, (number, differ.mean())


@pytest.mark.parametrize("name", FEW)
def test_transmitted_light_is_less_than_what_arrives(cpp, exported, read, name):
    """Diffuse light of both sides and light straight through, for unit colours that sum to 1."""
    cloth, rng = read(exported(name, kinds=(EVERY,))), np.random.default_rng(6)
    front, solid = hemisphere(48)
    for side in (1.0, -1.0):
        for deviation, curvature in ((0.02, 0.0), (0.3, 0.0), (4.0, 0.0), (0.3, 0.7 if side > 0.0 else 0.0)):
            wo = hemisphere(8)[0][rng.integers(64)] * (1.0, 1.0, side)
            shares = []
            for light in (1.0, -1.0):
                fixed = np.tile((*rng.uniform(0.0, 4.0, 2), deviation, 0.8 * deviation, -0.2), (len(front), 1))
                wi = front * (1.0, 1.0, light)
                rows = np.column_stack([fixed, wi, np.tile(wo, (len(wi), 1)), np.full(len(wi), curvature)])
                shares.append(solid @ cpp(cloth.buffers, rows)[:, :4].sum(axis=1))
            # The rule has 48 x 48 directions: a kink of a clipped cosine costs it some 1e-3.
            assert min(shares) > 0.005 and max(shares) < 1.3


@pytest.mark.parametrize("name", UNSEEN)
def test_extreme_footprints_are_answered(cpp, exported, read, name):
    """Deviations from 1e-5 to 1e5, ratios to 1e4, places to a million spacings."""
    cloth, rng, count = read(exported(name)), np.random.default_rng(8), 1500
    table = tabulate(load_fabric(name))
    z, turn = rng.uniform(0.01, 1.0, (2, count)), rng.uniform(0.0, 2.0 * np.pi, (2, count))
    level = np.sqrt(1.0 - z**2)
    wi, wo = np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=-1)
    sigma = 10.0 ** rng.uniform(-5.0, 5.0, count)
    u, v = rng.uniform(-1.0, 1.0, (2, count)) * 10.0 ** rng.uniform(0.0, 6.0, count)
    ratio, angle = 10.0 ** rng.uniform(-4.0, 0.0, count), rng.uniform(-2.0, 2.0, count)
    columns = (u, v, sigma, wi, wo, sigma * ratio, angle, np.zeros(count))
    queries = Queries(*(np.asarray(column, np.float32) for column in columns))
    expected = read_queries(table, queries)
    found = cpp(cloth.buffers, rows_of(queries))
    answers = np.concatenate([expected.components, expected.bounds], axis=1)
    differ = (np.abs(found - answers) / np.ptp(answers, axis=0)).max(axis=1) > ALLOWED["C++"]
    assert differ.mean() < 0.01 and (found >= 0.0).all()


def test_odd_footprints_are_answered_with_numbers(cpp, exported, read):
    cloth = read(exported("gauze"))
    rows = cloth.queries[:64].copy()
    rows[:16, 2:4], rows[16:32, 4], rows[32:48, 4], rows[40:48, 2:4] = 0.0, 1.0, -1.0, 1e9
    rows[48:56, 8:11], rows[56:, 5:8], rows[0, 0] = (1.0, 0.0, 1e-6), (0.0, 0.0, 1.0), 1e30
    assert np.isfinite(cpp(cloth.buffers, rows)).all()
