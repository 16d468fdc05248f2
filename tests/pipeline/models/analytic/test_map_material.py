import numpy as np
import pytest

from pipeline.materials.lobes import even_sky, reflectance
from pipeline.models.analytic.map_material import MapMaterialOptions
from pipeline.models.registry import load_methods
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric


@pytest.mark.parametrize("name", ["cotton_twill", pytest.param("gauze", marks=pytest.mark.slow)])
def test_highlights_have_the_energy_of_the_truth(name):
    """An even sky seen from above: some is lost where the maps' normals turn away from the light.

    Directions are drawn in proportion to the cosine, which is inside."""
    cloth, (method,) = load_fabric(name), load_methods(MapMaterialOptions(size=256, sheen=False))
    wi, none = even_sky(4096), np.zeros(4096)
    queries = Queries.round(none, none, none + 16.0, wi, np.tile([0.0, 0.0, 1.0], (4096, 1)))
    highlights = np.pi * (method.predict(cloth, queries)[:, :2] / wi[:, 2:]).mean(axis=0).sum()
    assert 0.8 < highlights / reflectance(cloth).specular.sum() < 1.0
