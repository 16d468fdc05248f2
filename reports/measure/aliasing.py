"""Aliasing on a moving, receding surface, as two numbers. Both are 0 for the truth.

Let L(f, p) be the luminance of frame f at pixel p while the surface moves by less than a pixel from frame to frame, T
the truth's, <T> the truth's mean over frames and pixels. Random methods draw anew in every frame, as renderers do.

flicker        (<var_f L(., p)>_p - <var_f T(., p)>_p) / <T>^2, with F - 1 in the denominator of var_f: temporal
               variance beyond the truth's own, which the motion itself brings. Negative: the method shows less of the
               motion than there is (it blurs).
excess energy  sum of (P_L(k) - P_T(k)) / <T>^2 over |k| > 1/4 cycle a pixel (half the Nyquist frequency), where P is
               the power spectrum of a frame less its mean under a Hann window, averaged over frames and scaled so that
               its sum over all k is the windowed variance: P(k) = |FFT(w (L - mean))|^2 / (N sum w^2)
               [Welch1967Spectra].

Noise of the truth adds to both of its terms: the mean squared standard error to the variance, and to every P_T(k) its
share sum(w^2 s^2) / (N sum w^2). Both are subtracted.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64

HALF_NYQUIST: Final = 0.25  # half the Nyquist frequency, in cycles a pixel


class TemporalSpectrum(NamedTuple):
    """Radially averaged power of pictures."""

    frequency: Float64  # middle of each ring, in cycles a pixel, rising to .5
    power: Float64  # mean P(k) in each ring
    high: float  # sum of P(k) beyond half the Nyquist frequency, corners of the square included


def flicker(frames: npt.ArrayLike, truth: npt.ArrayLike, truth_noise: npt.ArrayLike = 0.0) -> float:
    """Return the temporal variance beyond the truth's own, relative to the truth's squared mean.

    Luminance of the same pixels, (F, ...), and the standard error of the truth's; 0 where it is exact.
    """
    scale = float(np.asarray(truth, np.float64).mean()) ** 2
    return (temporal_variance(frames) - temporal_variance(truth, truth_noise)) / scale


def temporal_variance(frames: npt.ArrayLike, noise: npt.ArrayLike = 0.0) -> float:
    """Return the variance over frames, averaged over pixels, less the variance that noise adds."""
    variance = np.var(np.asarray(frames, np.float64), axis=0, ddof=1).mean()
    return float(variance - np.square(np.asarray(noise, np.float64)).mean())


def temporal_variances(frames: npt.ArrayLike, noise: npt.ArrayLike = 0.0) -> Float64:
    """Return the variance over frames of each pixel, less the variance that noise adds."""
    values = np.asarray(frames, np.float64)
    squared = np.broadcast_to(np.square(np.asarray(noise, np.float64)), values.shape)
    return np.asarray(np.var(values, axis=0, ddof=1) - squared.mean(axis=0))


def excess_energy(frames: npt.ArrayLike, truth: npt.ArrayLike, truth_noise: npt.ArrayLike = 0.0) -> float:
    """Return the energy beyond half the Nyquist frequency above the truth's, relative to the truth's squared mean.

    Luminance of the same rectangle of pixels, (F, H, W), and the standard error of the truth's.
    """
    scale = float(np.asarray(truth, np.float64).mean()) ** 2
    return (spectrum(frames).high - spectrum(truth, truth_noise).high) / scale


def spectrum(frames: npt.ArrayLike, noise: npt.ArrayLike = 0.0) -> TemporalSpectrum:
    """Return the power spectrum of luminance (F, H, W) averaged over frames, less the part of its standard error.

    Rings are as wide as one step of the shorter side's frequencies. The sum of P over all k, the mean's own k = 0
    included, is <w^2 (L - mean)^2> / <w^2>.
    """
    pictures = np.asarray(frames, np.float64)
    height, width = pictures.shape[1:]
    window = np.outer(np.hanning(height + 2)[1:-1], np.hanning(width + 2)[1:-1])
    energy = np.square(window).sum()

    # Power of each frame, its windowed mean removed so that no leakage of it remains.
    mean = (window * pictures).sum(axis=(1, 2), keepdims=True) / window.sum()
    power = np.square(np.abs(np.fft.fft2(window * (pictures - mean)))).mean(axis=0) / (pictures[0].size * energy)

    # White noise of local variance s^2 has the same expected power in every k.
    variance = np.broadcast_to(np.square(np.asarray(noise, np.float64)), pictures.shape).mean(axis=0)
    power -= (np.square(window) * variance).sum() / (pictures[0].size * energy)

    radius = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width)[None, :])
    edges = np.linspace(0.0, 0.5, min(height, width) // 2 + 1)
    ring = np.digitize(radius.ravel(), edges) - 1
    inside = ring < len(edges) - 1
    count = np.bincount(ring[inside], minlength=len(edges) - 1)
    total = np.bincount(ring[inside], weights=power.ravel()[inside], minlength=len(edges) - 1)
    return TemporalSpectrum(0.5 * (edges[1:] + edges[:-1]), total / count, float(power[radius > HALF_NYQUIST].sum()))
