"""No legal cloth makes light: in a white furnace, all that a viewer sees is at most 1, by the truth and by methods.

    E(wo) = integral over the sphere of f_P(wi, wo) d(wi), in the cloth's colours, + transparency

Directions are drawn from the lobes of the cloth, so a highlight of any roughness is found. A z-test at LEVEL,
Bonferroni over cloths, methods and channels.
"""

import math

import numpy as np
import pytest
from scipy import stats

from pipeline.analytic.exact_points import sample_points
from pipeline.analytic.soft_nodes.components import read_behind, read_queries
from pipeline.models.bounded import Bounded
from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.scenes.shade import coloured, colours_of
from pipeline.truth.cloth import cloth_side
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from tests.directions import unit
from tests.pipeline.analytic import methods
from tests.pipeline.models.stand_ins import FakeMethod
from tests.pipeline.truth.cloths import equal_queries, fixed
from tests.presets import slow
from weaves.draft import Draft
from weaves.fabric import Fabric
from weaves.yarn import Yarn

LEVEL = 1e-3
COUNT = 256  # directions of light
FEW = fixed(32)
RNG = np.random.default_rng


def matrices(random):
    while True:
        matrix = random.random(random.integers(2, 4, 2)) < 0.5
        sides = [line.any() and not line.all() for line in (*matrix, *matrix.T)]
        if all(sides) and Draft(matrix).hangs_together():
            return Draft(matrix).rows()


def between(random, low, high):
    """Draw an end of a range or a number inside, each a third of the time."""
    return float(random.choice([low, high, random.uniform(low, high)]))


def legal_cloth(index):
    """Draw a cloth from the whole legal space; its colours are as bright as is legal."""
    random = RNG([7, index])
    thickness = math.exp(between(random, math.log(1e-3), math.log(100.0)))
    thickness = min(max(thickness, 1e-3), 100.0)

    def yarn():
        shape = {"bend": between(random, 0.0, 85.0), "twist": between(random, -89.0, 89.0)}
        shape |= {"width": between(random, 0.3, 1.0), "relief": between(random, 0.01, 2.0)}
        alpha = min(max(math.exp(between(random, math.log(0.01), 0.0)), 0.01), 1.0)
        optics = {"roughness": alpha, "blend": between(random, 0.0, 1.0)}
        specular = tuple(between(random, 0.0, 1.0) for _ in range(3))
        most = Yarn(**shape, **optics, specular=specular).most_diffuse(thickness)
        share = between(random, 0.0, 1.0)
        diffuse, through = (tuple(part * k for k in most) for part in (share, 1.0 - share))
        return {**shape, **optics, "specular": specular, "diffuse": diffuse, "diffuse_transmission": through}

    draft = {"family": "matrix", "rows": matrices(random)}
    content = {"name": "legal", "optical_thickness": thickness, "draft": draft, "warp": yarn(), "weft": yarn()}
    return Fabric.model_validate(content)


def look(index, fabric):
    """Return equal looks at a random place of the cloth."""
    random = RNG([8, index])
    wo = unit(between(random, 0.0, 86.0), random.uniform(0.0, 360.0))
    place = random.random(2) * fabric.weave.repeat
    sigma = math.exp(random.uniform(math.log(0.01), math.log(8.0)))
    return equal_queries(wo, wo, sigma, COUNT, place)


def truth(fabric, queries):
    answers = estimate(fabric, queries, FEW, 3)
    return answers.mean, float(answers.transparency.mean())


def points(fabric, queries):
    cloth = cloth_side(fabric, TruthOptions())
    found = sample_points(cloth, queries, 16, 3, True)
    return found[:, :4], float(found[:, 4].mean())


def soft_nodes(fabric, queries):
    table = methods.soft_table(fabric, behind=True)
    front = queries.wi[:, 2] >= 0.0, lambda part: read_queries(table, part).components
    components = _by_rows(queries, front, (~front[0], lambda part: read_behind(table, part)[:, :4]))
    return components, float(read_behind(table, queries.take(slice(1))._replace(wi=-queries.wo[:1]))[0, 4])


def bounded(fabric, queries):
    """Return the most that the bound lets through."""
    bright = FakeMethod(lambda asked: np.full((len(asked.u), 4), 1e3, np.float32))
    method = Bounded(bright)
    return method.predict(fabric, queries), float(method.transparency(fabric, queries.take(slice(1)))[0])


def _by_rows(queries, *parts):
    result = np.zeros((len(queries.u), 4))
    for rows, answer in parts:
        if rows.any():
            result[rows] = answer(queries.take(rows))
    return result


METHODS = {f.__name__: f for f in (truth, points, soft_nodes, bounded)}
METHODS["averaged_normals"] = lambda fabric, queries: (  # it knows no light from behind, and no transparency
    _by_rows(queries, (queries.wi[:, 2] >= 0.0, lambda q: methods.averaged_normals(fabric, q))),
    0.0,
)


def scores(index, fabric, names=tuple(METHODS)):
    """Return by how much the energy of each method's brightest channel exceeds 1, and that in standard errors."""
    looks, result = look(index, fabric), {}
    drawn = PatchBSDF(fabric).draw(looks, RNG([9, index]).random((COUNT, 3)))
    scattered = ~drawn.straight[:, None]
    queries = looks._replace(wi=np.where(scattered, drawn.wi, looks.wo))
    colours = colours_of(fabric, queries)
    for name in names:
        components, through = METHODS[name](fabric, queries)
        weight = np.where(scattered, coloured(components, colours) / drawn.pdf[:, None], 0.0)
        excess = weight.mean(axis=0) + through - 1.0
        error = weight.std(axis=0, ddof=1) / math.sqrt(COUNT) + 1e-4
        result[name] = float(excess.max()), float((excess / error).max())
    return result


TABLES = ("soft_nodes", "bounded")


def of_turn(index):
    """Return the methods of a cloth; of those whose tables take long, one of two in turn."""
    turn = TABLES[index % len(TABLES)]
    return tuple(name for name in METHODS if name not in TABLES or name == turn)


@pytest.mark.parametrize("indices", [range(1, 3), *(slow(range(k, k + 100)) for k in range(0, 1000, 100))], ids=str)
def test_no_legal_cloth_makes_light(indices):
    results = {(i, name): both for i in indices for name, both in scores(i, legal_cloth(i), of_turn(i)).items()}
    limit = stats.norm.isf(LEVEL / (3 * len(METHODS) * 1000))
    assert max(z for _, z in results.values()) < limit, max(results.items(), key=lambda item: item[1][1])
    # The furnace is full: of some cloths the truth sends out more than nine tenths.
    assert max(excess for (_, name), (excess, _) in results.items() if name == "truth") > -0.1


@pytest.mark.parametrize("name", ["truth", "bounded"])
def test_illegal_colours_are_found(name):
    """What the rule leaves out makes light, and the test sees it: k_s = k_d = 1 over an even cloth."""
    fabric = legal_cloth(0)
    flat = {"bend": 0.0, "relief": 0.01, "width": 1.0, "roughness": 0.5, "specular": (1.0,) * 3, "diffuse": (1.0,) * 3}
    yarns = {side: getattr(fabric, side).model_copy(update=flat) for side in ("warp", "weft")}
    excess, z = scores(0, fabric.model_copy(update=yarns | {"optical_thickness": 2.0}), (name,))[name]
    assert excess > 0.3 and z > 8.0
