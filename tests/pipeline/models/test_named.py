import numpy as np
import pytest

from pipeline.models.fallback import fallback_rows
from pipeline.models.named import named_method, untrained_names
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

LIGHTS = np.array([[0.6, 0.0, 0.8], [0.6, 0.0, -0.8]])


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("selvage", {"": "error 2 %", ":.05": "error 5 %"}),
        ("soft_nodes", {"": "k = 8", ":1": "k = 1"}),
        ("point_sampled", {"": "k = 64", ":3": "k = 3"}),
    ],
)
def test_a_name_and_a_setting_load_a_method(name, settings):
    for text, setting in settings.items():
        method = named_method(name + text, "render", "--method")
        assert (method.name, method.setting) == (name, setting)


def test_every_method_answers_any_query_and_knows_what_the_fallback_lets_through():
    """Light from behind goes to the fallback, unless the method knows it; some know the transparency too."""
    denim = load_fabric("denim")
    queries = Queries.round([0.5, 0.5], [0.5, 0.5], [0.5, 0.5], LIGHTS, [[0, 0, 1]] * 2)
    expected = fallback_rows(denim, queries, 0)
    assert 0 < expected[1, 4] < 1
    for name in ("selvage", *untrained_names()):
        method = named_method(name, "render", "--method")
        method.prepare(denim)
        rows = method.rows(denim, queries, 0)
        assert np.isfinite(rows[:, :4]).all() and np.isnan(rows[0, 4])
        if name in ("map_material", "point_sampled", "selvage", "soft_nodes"):
            assert np.isnan(rows[1, 4])
        else:
            np.testing.assert_array_equal(rows[1], expected[1])
        np.testing.assert_array_equal(rows[:, :4], method.predict(denim, queries, 0))
        error = {"selvage": 0.01, "soft_nodes": 0.01, "point_sampled": 0.1}.get(name, 0.0)
        np.testing.assert_allclose(method.transparency(denim, queries, 0), expected[:, 4], rtol=0, atol=error)
