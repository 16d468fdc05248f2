"""Visibility of the difference of two films: FovVideoVDP [Mantiuk2021FovVideoVDP], where it is installed.

A score in JOD (just-objectionable differences): 10 for films that look the same, one less where 3 of 4 people prefer
the truth; sustained and transient contrast count, so flicker does. Films are luminance on a display of stated size,
distance and light (`DisplayOptions`): Y = peak min(max(exposure L, 0), 1) + peak / contrast. Frames are fewer than the
quarter of a second that the metric looks back: the first one is taken to have stood still before.

`pyfvvdp` may not be used commercially and is therefore no dependency; `pip install pyfvvdp` adds the measure.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from reports.options import DisplayOptions
from reports.record import Record
from weaves.errors import BadInput


def absence() -> str:
    """Return one sentence that says why the measure is missing; empty where it is not."""
    try:
        _library()
    except ImportError as error:
        return f"FovVideoVDP is not measured: {error}; pip install pyfvvdp adds it."
    return ""


def fovvideovdp(frames: npt.ArrayLike, truth: npt.ArrayLike, options: DisplayOptions | None = None) -> float | None:
    """Return the quality of a film in JOD; None where pyfvvdp is not installed.

    Parameters
    ----------
    frames, truth : array_like (F, H, W)
        Linear luminance of the method's frames and of the truth's, irradiance included (as in
        `reports.measure.pictures`).

    Raises
    ------
    BadInput
        If sizes differ, there are fewer than two frames, or a value is not finite.
    """
    options = options or DisplayOptions()
    film, reference = (np.asarray(values, np.float64) for values in (frames, truth))
    if film.shape != reference.shape or film.ndim != 3 or len(film) < 2:
        raise BadInput(
            "FovVideoVDP", "frames", film.shape, f"two or more of the truth's size {reference.shape} are needed"
        )
    if not (np.isfinite(film).all() and np.isfinite(reference).all()):
        raise BadInput("FovVideoVDP", "frames", "not finite", "every pixel needs a number")
    if absence():
        return None
    metric = _metric(options)
    light = [(options.peak * np.clip(options.exposure * a, 0.0, 1.0)).astype(np.float32) for a in (film, reference)]
    return float(metric.predict(*light, dim_order="FHW", frames_per_second=options.frames_per_second)[0])


def fovvideovdp_records(
    subject: Record, frames: npt.ArrayLike, truth: npt.ArrayLike, options: DisplayOptions | None = None
) -> list[Record]:
    """Return the score as a Record of `subject`; none where pyfvvdp is not installed."""
    score = fovvideovdp(frames, truth, options)
    return [] if score is None else [subject.of("fovvideovdp", score, len(np.asarray(truth)))]


def _metric(options: DisplayOptions) -> Any:
    library = _library()
    return library.fvvdp(
        display_photometry=library.fvvdp_display_photo_eotf(options.peak, contrast=options.contrast, EOTF="linear"),
        display_geometry=library.fvvdp_display_geometry(
            options.resolution, distance_m=options.distance, diagonal_size_inches=options.diagonal
        ),
        device="cpu",
        quiet=True,
    )


def _library() -> Any:
    import pyfvvdp

    return pyfvvdp
