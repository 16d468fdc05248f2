from itertools import pairwise

import numpy as np
import pytest

from pipeline.models.fallback import fallback_answers
from pipeline.models.selvage import errors
from pipeline.models.selvage.cloth_numbers import FLOOR, GREY, NUMBERS, colours, numbers_of, probes
from pipeline.models.selvage.errors import CASES, OF_CLOTH, RANGES, TERMS, coefficients_of, expected, squares_and_kinds
from pipeline.models.selvage.model import Selvage
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric
from weaves.population import Population, population_fabrics

DENIM = load_fabric("denim")


def test_the_table_has_a_row_for_every_case_and_a_query_errs_alike_alone_and_among_others():
    table = expected("errors")
    assert [len(rows) for rows in table] == [6, 6, 5, 5] and len(table) == CASES
    assert {len(row) for rows in table for row in rows} == {TERMS + (NUMBERS - 1) * len(OF_CLOTH)}
    times = np.array(expected("microseconds"))
    assert times.shape == (RANGES * CASES, 6) and (times > 0.0).all()
    queries = probes(DENIM, False, False, 16)
    np.testing.assert_allclose(colours(DENIM, queries)[:, -1], fallback_answers(DENIM, queries, 0) @ GREY, rtol=1e-6)
    # Whatever side the others are lit from; mirrored queries have the same errors.
    front, behind = probes(DENIM, False, False, 20), probes(DENIM, True, True, 20)
    whole, kinds = squares_and_kinds(front, coefficients_of(DENIM, True))
    assert set(kinds // RANGES) == {0}
    np.testing.assert_array_equal(whole, squares_and_kinds(front, coefficients_of(DENIM, False))[0])
    mirrored = front._replace(wi=front.wi * np.float32([-1, 1, 1]), wo=front.wo * np.float32([-1, 1, 1]))
    np.testing.assert_array_equal(whole, squares_and_kinds(mirrored, coefficients_of(DENIM, True))[0])
    squares, kinds = squares_and_kinds(behind, coefficients_of(DENIM, True))
    assert set(kinds // RANGES) == {3} and (squares[-1] > 1.0).all(), "no fallback of curved cloth"


def test_numbers_of_a_cloth_are_differences_of_its_answers_and_end_where_those_of_the_table_end(monkeypatch):
    """Equal answers have the least number; a difference e times as large adds 1."""
    same = np.full((10, 6), 0.2)
    numbers = numbers_of(same)
    assert numbers[0] == 1.0 and (numbers[1:] == numbers[1]).all()
    one, other = same.copy(), same.copy()
    one[:, 0] += 0.01
    other[:, 0] += 0.01 * np.e
    assert numbers_of(other)[1] - numbers_of(one)[1] == pytest.approx(1.0)
    np.testing.assert_array_equal(numbers_of(one)[2:], numbers[2:])
    sides = []
    least, most = expected("numbers")[0]
    for counted in (least - 1.0, least, 0.5 * (least + most), most, most + 1.0):
        monkeypatch.setattr(errors, "numbers_of", lambda _, counted=counted: counted)
        sides.append(errors._side(DENIM, False))
    assert [(one == other).all() for one, other in pairwise(sides)] == [True, False, False, True]


@pytest.mark.slow
@pytest.mark.parametrize("curved", [False, True])
def test_expected_errors_are_calibrated_on_cloth_never_seen(curved):
    """True errors of what is chosen over the expected ones, root mean squares over 24 random cloths, for each light.

    Between .8 and 1.25. The table was not fitted to these cloths. Patches hidden almost wholly are left out.
    """
    families = ("plain", "compound_twill", "large_satin", "irregular")
    fabrics = population_fabrics(Population(count=24, seed=6151, families=families, balanced=True, solid=0.5))
    selvage = Selvage()
    for behind in (False, True):
        true, stated = {}, {}
        for fabric in fabrics:
            queries = probes(fabric, behind, curved, 400, 77)
            truth = estimate(fabric, queries, TruthOptions(relative_error=0.02), 3)
            colour, answers = truth.mean @ GREY, colours(fabric, queries)
            noise = np.linalg.norm(truth.standard_error * GREY, axis=1) / (colour + FLOOR)
            squares = np.minimum(((answers - colour[:, None]) / (colour + FLOOR)[:, None]) ** 2, 4.0)
            seen = np.flatnonzero(truth.mean.any(axis=1) & (answers > 0.0).any(axis=1))
            for wished in (0.05, 0.02, 0.01):
                chosen = selvage.choose(fabric, queries, error=wished)[seen]
                true.setdefault(wished, []).append(squares[seen, chosen] - noise[seen] ** 2)
                own = selvage.expected_errors(fabric, queries)[seen, chosen]
                stated.setdefault(wished, []).append(np.square(own, dtype=np.float64))
        for wished, parts in true.items():
            ratio = np.concatenate(parts).mean() / np.concatenate(stated[wished]).mean()
            assert 0.8 < np.sqrt(max(ratio, 0.0)) < 1.25, (behind, wished)
