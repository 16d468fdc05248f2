import numpy as np
import pytest

from pipeline.models.selvage.choice import PRICES, choose_at, error_curve, price_of, within_time

SECONDS = np.array([[1e-6, 2e-6, 8e-6], [3e-6, 4e-6, 5e-6]])
"""Of two kinds of queries, by answer."""


def drawn(rows):
    """Return squared errors that mostly fall from answer to answer, and kinds."""
    random = np.random.default_rng(7)
    squares = np.exp(random.normal([-6.0, -7.5, -9.0], 1.5, (rows, 3))).astype(np.float32)
    return squares.T, random.integers(0, 2, rows)


def totals(squares, kinds, chosen):
    """Return the mean squared error and the mean seconds of a choice."""
    return squares[chosen, np.arange(len(kinds))].mean(dtype=np.float64), SECONDS[kinds, chosen].mean()


@pytest.mark.parametrize("time", [2.1e-6, 3e-6, 4e-6, 1e-5])
def test_no_other_choice_in_the_same_time_has_less_error(time):
    """Of six queries all 3^6 choices are compared; what the price leaves of the time is at most one query's step."""
    squares, kinds = drawn(6)
    chosen = within_time(squares, kinds, SECONDS, time)
    error, seconds = totals(squares, kinds, chosen)
    assert seconds <= time
    for other in np.ndindex(*[3] * 6):
        of_other = totals(squares, kinds, np.array(other))
        assert of_other[1] > seconds * (1 + 1e-12) or of_other[0] >= error * (1 - 1e-6)


def test_the_wished_time_is_used_up_and_the_price_of_an_error_is_the_highest_that_keeps_it():
    squares, kinds = drawn(20_000)
    least, most = SECONDS[kinds].min(axis=1).mean(), totals(squares, kinds, squares.argmin(axis=0))[1]
    for time in np.linspace(least, most, 5)[1:-1]:
        _, seconds = totals(squares, kinds, within_time(squares, kinds, SECONDS, time))
        assert 0.93 * time < seconds <= time
    assert not within_time(squares, kinds, SECONDS, SECONDS[kinds, 0].mean()).any()
    np.testing.assert_array_equal(within_time(squares, kinds, SECONDS, 1.0), squares.argmin(axis=0))
    curve = error_curve(squares, kinds, SECONDS)
    assert (np.diff(curve) >= 0).all()
    for error in np.sqrt(curve[[50, 200, 300]] * 1.0001):
        price = price_of(curve, error)
        dearer = PRICES[np.searchsorted(PRICES, price) + 20]
        kept, lost = (totals(squares, kinds, choose_at(squares, kinds, p * SECONDS))[0] for p in (price, dearer))
        assert kept <= error**2 and (lost > error**2 or price > 1e4)
    assert price_of(curve, 1e-9) == 0.0
