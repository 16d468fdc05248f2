import numpy as np
import pytest

from reports.measure.aliasing import excess_energy, flicker, spectrum, temporal_variance, temporal_variances

X = np.arange(96)
Y = np.arange(64)[:, None]


@pytest.mark.parametrize(("cycles", "high"), [(0.125, 0.0), (0.375, 1.0)])
def test_spectrum_of_a_known_sinusoid(cycles, high):
    """a cos(2 pi k x) has the variance a^2/2, all of it at its own frequency: beyond 1/4 or not at all."""
    picture = 1 + 0.2 * np.cos(2 * np.pi * cycles * X) + 0 * Y
    found = spectrum(picture[None])
    assert found.high == pytest.approx(high * 0.2**2 / 2, rel=0.02, abs=1e-7)
    assert found.frequency[np.argmax(found.power)] == pytest.approx(cycles, abs=1 / 64)


def test_noise_of_the_truth_is_subtracted():
    """White noise of known size, 12 frames: what is left is zero within 5 standard errors of the estimate.

    Sizes: the variance of N values has the relative error sqrt(2/N), N = 12 · 96 · 64 (under the window about a third).
    """
    random = np.random.default_rng(4)
    size = 0.2 + 0.1 * np.sin(X / 9) + 0 * Y
    clean = 1 + 0.5 * np.sin(X / 15) + 0 * Y
    noisy = clean + size * random.standard_normal((12, 64, 96))
    noise = np.broadcast_to(size, noisy.shape)
    raw = temporal_variance(noisy)
    assert raw == pytest.approx(np.square(size).mean(), rel=0.02)
    assert abs(temporal_variance(noisy, noise)) < 5 * raw * np.sqrt(2 / noisy.size)
    energy = spectrum(noisy).high
    window = np.square(np.outer(np.hanning(66)[1:-1], np.hanning(98)[1:-1]))
    share = 1 - np.pi / 16  # of the square of k lies beyond the circle
    assert energy == pytest.approx(share * (window * size**2).sum() / window.sum(), rel=0.03)
    assert abs(spectrum(noisy, noise).high) < 5 * energy * np.sqrt(2 * 3 / noisy.size)


def test_power_sums_to_the_windowed_variance_and_flicker_is_that_of_a_known_sinusoid():
    random = np.random.default_rng(5)
    picture = random.standard_normal((1, 40, 56))
    window = np.outer(np.hanning(42)[1:-1], np.hanning(58)[1:-1])
    mean = (window * picture[0]).sum() / window.sum()
    variance = (window**2 * (picture[0] - mean) ** 2).sum() / (window**2).sum()
    radius = np.hypot(np.fft.fftfreq(40)[:, None], np.fft.fftfreq(56)[None, :])
    found = spectrum(picture)
    # Rings hold |k| < .5; what lies in the corners is counted in `high` alone.
    rings = np.bincount(np.digitize(radius.ravel(), np.linspace(0, 0.5, 21)) - 1, minlength=20)[:20]
    assert (found.power * rings).sum() < variance
    low = (found.power * rings)[found.frequency < 0.25].sum()
    assert low + found.high == pytest.approx(variance, rel=0.01)
    random = np.random.default_rng(5)
    shown, noise = random.random((4, 6, 7)), 0.1 * random.random((4, 6, 7))
    variances = temporal_variances(shown, noise)
    assert variances.shape == (6, 7) and variances.mean() == pytest.approx(temporal_variance(shown, noise), rel=1e-12)
    # Two frames that differ by d have the variance d^2 / 2.
    assert temporal_variances(np.array([[1.0, 2.0], [1.0, 5.0]]), 0.5) == pytest.approx([-0.25, 4.5 - 0.25])
    # L = 2 + a cos(2 pi f / 8 + phase): over 8 frames the variance is a^2/2 · 8/7; the truth stands still at 2.
    moving = 2 + 0.3 * np.cos(2 * np.pi * np.arange(8)[:, None] / 8 + np.linspace(0, 6, 50))
    still = np.full_like(moving, 2.0)
    assert flicker(moving, still) == pytest.approx(0.3**2 / 2 * 8 / 7 / 4)
    assert flicker(still, moving) == pytest.approx(-(0.3**2) / 2 * 8 / 7 / moving.mean() ** 2)


def test_both_figures_fall_as_one_over_the_number_of_points():
    """Independent draws in every frame and pixel, k averaged: variance and energy beyond the truth's fall as 1/k.

    Each figure's relative error is about sqrt(2/N), N = 8 · 96 · 64 (under the window about a third of it): 5 allowed.
    """
    truth = 1 + 0.5 * np.sin(X / 5 + 0.3 * np.arange(8)[:, None, None]) + 0 * Y
    random = np.random.default_rng(6)
    found = {k: truth + 0.3 * random.standard_normal((k, *truth.shape)).mean(axis=0) for k in (1, 4, 16)}
    for measure, expected in ((flicker, 0.09), (excess_energy, 0.09 * (1 - np.pi / 16))):
        values = {k: k * measure(shown, truth) * truth.mean() ** 2 for k, shown in found.items()}
        assert values[1] == pytest.approx(expected, rel=5 * np.sqrt(2 * 3 / truth.size))
        # The cross term with the truth's own motion counts more the smaller the noise is.
        assert list(values.values()) == pytest.approx([expected] * 3, rel=0.15)
