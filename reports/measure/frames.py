"""Frames of the moving plane, by the truth and by methods, and their aliasing (`reports.measure.aliasing`).

The truth's frames are one OpenEXR: luminance Y and its standard error, one frame below the other.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64, Mask
from pipeline.fingerprint import fingerprint
from pipeline.models.method import Method
from pipeline.scenes.gbuffer import GBuffer
from pipeline.scenes.shade import coloured, shade
from pipeline.scenes.views import view
from pipeline.truth.estimator import estimate
from pipeline.truth.scattering.thread_colours import component_colours
from reports.error import colour_noise
from reports.images.exr import read_exr, write_exr
from reports.measure.aliasing import excess_energy, flicker, spectrum, temporal_variance
from reports.options import FrameOptions
from reports.record import TRUTH, Record
from weaves.colour import LUMINANCE
from weaves.fabric import Fabric

_LUMINANCE = np.array(LUMINANCE)[:, None]


class _Frames(NamedTuple):
    """The truth's frames under unit irradiance."""

    truth: Float64  # luminance, (F, H, W); 0 where no cloth is lit
    noise: Float64  # its standard error
    lit: Mask  # pixels that show lit cloth, (H, W); the same in every frame

    def spectrum_of(self, subject: Record, frames: Float64, noise: Float64) -> Record:
        """Return the radially averaged spectrum of the rows that are lit from end to end, over the truth's mean^2."""
        rows = self.lit.all(axis=1)
        rings, mean = spectrum(frames[:, rows], noise[:, rows]), float(self.truth[:, rows].mean())
        curve = tuple((float(k), float(p) / mean**2) for k, p in zip(rings.frequency, rings.power, strict=True))
        return subject.of("spectrum", rings.high / mean**2, len(frames), curve=curve)


def render_frames(fabric: Fabric, options: FrameOptions, path: Path) -> None:
    """Write the truth's frames of the moving plane to `path`."""
    values, errors = [], []
    for index in range(options.frames):
        gbuffer = _view(options, index)
        seed = int(fingerprint(["frame", fabric.name, index, options.seed]), 16)
        queries = gbuffer.queries(fabric.repeat)
        answers = estimate(fabric, queries, options.frame_truth, seed)
        luminances = component_colours(fabric, queries, options.frame_truth, seed).mean @ _LUMINANCE
        values.append(_spread(gbuffer, coloured(answers.mean, luminances)))
        errors.append(_spread(gbuffer, colour_noise(answers, luminances)))
    channels = {"Y": np.concatenate(values), "error.Y": np.concatenate(errors)}
    write_exr(path, channels, {"fabric": fabric.name, "scene": "plane", "method": TRUTH, "frames": options.frames})


def measure_aliasing(method: Method, fabric: Fabric, options: FrameOptions, frames: Path) -> list[Record]:
    """Measure flicker and excess energy of a method, which must cover the fabric, on the moving plane.

    `frames` are the truth's, which `render_frames` wrote with the same options.
    """
    reference = _read(frames, options)
    method.prepare(fabric)
    planes = []
    for index in range(options.frames):
        gbuffer = _view(options, index)
        seed = int(fingerprint(["aliasing", fabric.name, index, options.seed]), 16)
        queries = gbuffer.queries(fabric.repeat)
        values = method.predict(fabric, queries, seed)
        planes.append(_spread(gbuffer, shade(fabric, values, queries, bounces=1) @ _LUMINANCE))
    shown = np.array(planes)
    lit, rows = reference.lit, reference.lit.all(axis=1)
    subject = Record(method=method.name, setting=method.setting, fabric=fabric.name, scene="plane")
    motion = flicker(shown[:, lit], reference.truth[:, lit], reference.noise[:, lit])
    energy = excess_energy(shown[:, rows], reference.truth[:, rows], reference.noise[:, rows])
    return [
        subject.of("flicker", motion, options.frames),
        subject.of("excess_energy", energy, options.frames),
        reference.spectrum_of(subject, shown, np.zeros_like(shown)),
    ]


def measure_truth_frames(fabric: Fabric, options: FrameOptions, frames: Path) -> list[Record]:
    """Measure the truth's own frames: the variance that the motion brings, and their spectrum."""
    reference = _read(frames, options)
    subject = Record(method=TRUTH, fabric=fabric.name, scene="plane")
    truth, noise = reference.truth[:, reference.lit], reference.noise[:, reference.lit]
    motion = temporal_variance(truth, noise) / float(truth.mean()) ** 2
    own = reference.spectrum_of(subject, reference.truth, reference.noise)
    return [subject.of("motion", motion, options.frames), own]


def _view(options: FrameOptions, index: int) -> GBuffer:
    return view("plane", *options.frame_size, frame=index, options=options.view)


def _read(path: Path, options: FrameOptions) -> _Frames:
    width, height = options.frame_size
    channels = read_exr(path).channels
    truth, noise = (channels[name].astype(np.float64).reshape(-1, height, width) for name in ("Y", "error.Y"))
    return _Frames(truth, noise, _view(options, 0).lit)


def _spread(gbuffer: GBuffer, values: npt.NDArray[np.floating]) -> Float64:
    """Spread the values of lit pixels, (N, 1), over the picture, (H, W); 0 elsewhere."""
    plane = np.zeros(gbuffer.lit.shape)
    plane[gbuffer.lit] = values[:, 0]
    return plane
