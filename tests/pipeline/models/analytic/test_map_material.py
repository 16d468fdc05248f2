import numpy as np
import pytest

from pipeline.materials.lobes import even_sky, reflectance
from pipeline.models.analytic.map_material import MapMaterialOptions
from pipeline.models.registry import load_methods
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from tests.pipeline.models.against_truth import colour_error, truth_of
from tests.pipeline.truth.cloths import woven
from tests.refusals import refusal
from weaves.fabric import load_fabric


def under_an_even_sky(method, cloth, wo):
    """Return the mean answers for directions in proportion to the cosine, which is inside, from one viewer."""
    wi = even_sky(4096)
    none = np.zeros(len(wi))
    queries = Queries.round(none, none, none + 16.0, wi, np.tile(wo, (len(wi), 1)))
    return (np.pi * method.predict(cloth, queries) / wi[:, 2:]).mean(axis=0)


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
    cloth, (method,) = load_fabric("denim"), load_methods(MapMaterialOptions(size=256))
    queries = draw_queries(kinds, cloth.weave.repeat, 2, 0, 400)
    error = colour_error(method.predict(cloth, queries), truth_of(cloth, queries, relative_error=0.02))
    # Nothing is fitted to it, so it cannot be as good as a method that knows the yarns.
    assert 0.05 < error < bound


@pytest.mark.parametrize("name", ["cotton_twill", "gauze"])
def test_highlights_have_the_energy_of_the_truth(name):
    """An even sky seen from above: some is lost where the maps' normals turn away from the light."""
    cloth, (method,) = load_fabric(name), load_methods(MapMaterialOptions(size=256, sheen=False))
    highlights = under_an_even_sky(method, cloth, [0.0, 0.0, 1.0])[:2].sum()
    assert 0.8 < highlights / reflectance(cloth).specular.sum() < 1.0


@pytest.mark.slow
def test_an_even_sky_is_not_made_brighter_and_the_size_of_maps_is_checked():
    cloth, (method,) = load_fabric("denim"), load_methods(MapMaterialOptions(size=128))
    for angle in (0.0, 1.4):
        answers = under_an_even_sky(method, cloth, [np.sin(angle), 0.0, np.cos(angle)])
        assert answers @ [0.3, 0.3, 1.0, 1.0] < 1.0
    wide = ["".join("#."[(3 * x + 5 * y) % 32 < 16] for x in range(32)) for y in range(32)]
    assert "needs 128" in refusal(load_methods(MapMaterialOptions(size=64))[0].prepare, woven("denim", wide))
