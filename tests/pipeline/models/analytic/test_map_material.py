import numpy as np
import pytest
from pydantic import ValidationError

from pipeline.materials.lobes import even_sky, reflectance
from pipeline.models.analytic.map_material import MapMaterialOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.draft import Matrix
from weaves.errors import BadInput
from weaves.fabric import load_fabric

COLOUR = np.array([0.3, 0.3, 0.5, 0.5])


def asked(name, kinds, rows=400, **options):
    cloth = load_fabric(name)
    queries = draw_queries(kinds, cloth.weave.repeat, 2, 0, rows)
    (method,) = load_methods(MapMaterialOptions(size=256, **options))
    truth = estimate(cloth, queries, TruthOptions(relative_error=0.02), 1).mean
    return method.predict(cloth, queries), truth


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kinds", "bound"),
    [
        (QueryOptions(sigma=(3.0, 4.0)), 0.25),
        (QueryOptions(sigma=(0.2, 0.4), stretch=8.0), 0.35),
        (QueryOptions(sigma=(3.0, 4.0), behind=1.0), 0.45),
    ],
    ids=["far", "long", "behind"],
)
def test_it_errs_as_a_material_does(kinds, bound):
    """RMSE of the colour over the mean: no hiding of yarns by yarns, but the right energy."""
    found, truth = asked("denim", kinds)
    error = np.sqrt(np.mean(((found - truth) @ COLOUR) ** 2)) / np.mean(truth @ COLOUR)
    assert error < bound
    # Nothing is fitted to it, so it cannot be as good as a method that knows the yarns.
    assert error > 0.05


@pytest.mark.parametrize("name", ["cotton_twill", "gauze"])
def test_highlights_have_the_energy_of_the_truth(name):
    """An even sky seen from above: some is lost where the maps' normals turn away from the light."""
    cloth, (method,) = load_fabric(name), load_methods(MapMaterialOptions(size=256, sheen=False))
    wi = even_sky(4096)
    none = np.zeros(len(wi))
    queries = Queries.round(none, none, none + 16.0, wi, np.tile([0.0, 0.0, 1.0], (len(wi), 1)))
    found = (np.pi * method.predict(cloth, queries) / wi[:, 2:]).mean(axis=0)
    share = found[:2].sum() / reflectance(cloth).specular.sum()
    assert 0.8 < share < 1.0


def test_an_even_sky_is_not_made_brighter():
    cloth, (method,) = load_fabric("satin_8"), load_methods(MapMaterialOptions(size=128))
    wi = even_sky(4096)
    none = np.zeros(len(wi))
    for angle in (0.0, 0.8, 1.4):
        wo = np.tile([np.sin(angle), 0.0, np.cos(angle)], (len(wi), 1))
        answers = method.predict(cloth, Queries.round(none, none, none + 16.0, wi, wo))
        # The incident cosine is inside: directions are drawn in proportion to it.
        assert (np.pi * answers / wi[:, 2:]).mean(axis=0) @ np.array([0.3, 0.3, 1.0, 1.0]) < 1.0


def test_the_size_of_the_maps_is_checked():
    with pytest.raises(ValidationError, match="power of two"):
        MapMaterialOptions(size=100)
    (method,) = load_methods(MapMaterialOptions(size=64))
    wide = Matrix(rows=tuple("".join("#."[(3 * x + 5 * y) % 32 < 16] for x in range(32)) for y in range(32)))
    with pytest.raises(BadInput, match="needs 128"):
        method.prepare(load_fabric("denim").model_copy(update={"draft": wide}))
