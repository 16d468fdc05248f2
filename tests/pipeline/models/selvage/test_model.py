import numpy as np
import pytest

from pipeline.models.all_cores import AllCores
from pipeline.models.analytic.soft_nodes import SoftNodes
from pipeline.models.fallback import fallback_answers
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.cloth_numbers import NODE_LEVELS, probes
from pipeline.models.selvage.model import Selvage
from tests.refusals import refusal
from weaves.errors import BadInput
from weaves.fabric import load_fabric

DENIM = load_fabric("denim")


@pytest.fixture(scope="module")
def queries():
    return probes(DENIM, False, False, 600, 3)


def expected(selvage, queries, chosen):
    """Return the expected root mean square of what is chosen."""
    errors = selvage.expected_errors(DENIM, queries)[np.arange(len(chosen)), chosen]
    return np.sqrt(np.mean(np.square(errors, dtype=np.float64)))


def test_every_query_gets_the_answer_chosen_by_itself_and_more_time_has_less_error(selvage, queries):
    chosen = selvage.choose(DENIM, queries, error=0.012)
    answers = selvage.predict(DENIM, queries, 5, error=0.012)
    assert len(np.unique(chosen)) >= 4
    for place, level in enumerate(NODE_LEVELS):
        rows = chosen == place
        np.testing.assert_array_equal(answers[rows], SoftNodes(level).predict(DENIM, queries.take(rows)))
    best = selvage.choose(DENIM, queries, error=1e-6) == len(NODE_LEVELS)
    assert best.any()
    left = selvage.predict(DENIM, queries, 5, error=1e-6)[best]
    np.testing.assert_array_equal(left, fallback_answers(DENIM, queries.take(best), 5))
    whole = selvage.choose(DENIM, queries, error=0.012)
    part = selvage.choose(DENIM, queries.take(slice(7, 20)), error=0.012)
    np.testing.assert_array_equal(whole[7:20], part)
    np.testing.assert_array_equal(Selvage(0.012).choose(DENIM, queries), whole)
    # Over other queries of the distribution that prices are found on, to chance; a smaller wish hardly ever has a
    # cheaper answer.
    queries = probes(DENIM, False, False, 2000, 8, ("projected_disc",))
    last = None
    for wished in (0.02, 0.015, 0.012, 0.01):
        chosen = selvage.choose(DENIM, queries, error=wished)
        assert expected(selvage, queries, chosen) < 1.15 * wished
        assert last is None or (chosen >= last).mean() > 0.95
        last = chosen
    errors = [expected(selvage, queries, selvage.choose(DENIM, queries, time=time)) for time in (1e-4, 3e-4, 1e-2)]
    assert errors[0] >= errors[1] >= errors[2]
    best = selvage.expected_errors(DENIM, queries).argmin(axis=1)
    np.testing.assert_array_equal(selvage.choose(DENIM, queries, time=1e-2), best)
    for wish in ({"error": 0.01}, {"time": 1e-4}):
        assert selvage.predict(DENIM, queries.take(slice(0)), **wish).shape == (0, 4)


def test_light_from_behind_and_curved_cloth_are_answered_but_another_meaning_of_walls_has_no_fallback(selvage, queries):
    mixed = probes(DENIM, True, True, 40)
    answers = selvage.predict(DENIM, mixed)
    assert (selvage.choose(DENIM, mixed, error=1e-6) < len(NODE_LEVELS)).all(), "soft nodes alone"
    assert np.isfinite(answers).all() and (answers >= 0).all()
    assert "viewers in front" in refusal(selvage.predict, DENIM, mixed._replace(wo=-mixed.wo))
    options = SelvageOptions(errors=[0.1, 0.025])
    assert [method.setting for method in options.methods()] == ["error 10 %", "error 2.5 %"]
    assert not options.learns and options.single()[1].settings == (0.025,)
    other = Selvage(1e-6, walls="left_out")
    assert (other.choose(DENIM, queries) < len(NODE_LEVELS)).all()
    chosen = other.choose(DENIM, queries) == NODE_LEVELS.index(8)
    finest = SoftNodes(8, walls="left_out").predict(DENIM, queries.take(chosen))
    np.testing.assert_array_equal(other.predict(DENIM, queries)[chosen], finest)


@pytest.mark.parametrize(
    ("wish", "says"),
    [
        ({"error": 0.0}, "error = 0.0: a relative error above 0 and below 1"),
        ({"error": float("nan")}, "above 0 and below 1"),
        ({"time": -1.0}, "time = -1.0: seconds a query above 0"),
        ({"time": float("inf")}, "seconds a query above 0"),
        ({"time": 1e-12}, "these queries take at least"),
        ({"error": 0.1, "time": 1e-5}, "only one of them can be wished"),
    ],
)
def test_wishes_that_cannot_be_kept_get_a_sentence(selvage, queries, wish, says):
    with pytest.raises(BadInput) as refused:
        selvage.predict(DENIM, queries, **wish)
    assert says in str(refused.value)


@pytest.mark.parametrize("wish", [{"error": 0.05}, {"time": 1e-4}])
def test_other_methods_refuse_wishes(queries, wish):
    assert "only selvage answers within a wished" in refusal(AllCores(SoftNodes(1)).predict, DENIM, queries, **wish)
