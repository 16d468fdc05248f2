"""Pictures of the views, by the truth and by methods, and the errors of methods.

A picture is a linear OpenEXR: R, G, B under the light of the view, A = 1 where there is cloth; the truth's holds the
standard error of each colour beside them.
"""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Mask
from pipeline.fingerprint import fingerprint
from pipeline.models.method import Method
from pipeline.scenes.gbuffer import GBuffer
from pipeline.scenes.options import View
from pipeline.scenes.shade import compose, shade
from pipeline.scenes.views import view
from pipeline.truth.estimator import estimate
from pipeline.truth.scattering.thread_colours import component_colours
from reports.error import colour_noise, squared_error
from reports.images.exr import RGB, read_exr, write_exr
from reports.options import PictureOptions
from reports.record import TRUTH, Record
from weaves.fabric import Fabric

ERROR: Final = ("error.R", "error.G", "error.B")  # channels of its standard error


def render_truth(fabric: Fabric, scene: View, options: PictureOptions, path: Path) -> None:
    """Write the truth's picture of a scene to `path`."""
    gbuffer = view(scene, *options.size(scene), options=options.view)
    seed = int(fingerprint(["truth", fabric.name, scene, options.seed]), 16)
    queries = gbuffer.queries(fabric.repeat)
    answers = estimate(fabric, queries, options.truth, seed)
    colours = component_colours(fabric, queries, options.truth, seed).mean
    noise = compose(gbuffer, colour_noise(answers, colours))
    picture = compose(gbuffer, shade(fabric, answers.mean, queries, colours=colours))
    write_picture(path, picture, gbuffer.mask, {**_about(fabric, scene, gbuffer), "method": TRUTH}, noise)


def render_method(
    method: Method, fabric: Fabric, scene: View, options: PictureOptions, truth: Path, path: Path
) -> list[Record]:
    """Write a method's picture of a scene to `path` and measure its MSE over the lit pixels.

    The method must cover the fabric; `truth` is the picture that `render_truth` wrote with the same options.
    """
    gbuffer = view(scene, *options.size(scene), options=options.view)
    seed = int(fingerprint(["picture", fabric.name, scene, options.seed]), 16)
    method.prepare(fabric)
    queries = gbuffer.queries(fabric.repeat)
    picture = compose(gbuffer, shade(fabric, method.predict(fabric, queries, seed), queries))
    about = {**_about(fabric, scene, gbuffer), "method": method.name, "setting": method.setting}
    write_picture(path, picture, gbuffer.mask, about)
    reference = read_exr(truth)
    lit = gbuffer.lit
    error = squared_error(picture[lit], reference.stack(*RGB)[lit], reference.stack(*ERROR)[lit], resamples=0)
    return Record(method=method.name, setting=method.setting, fabric=fabric.name, scene=scene).of_error(error)


def write_picture(
    path: Path,
    picture: npt.NDArray[np.floating],
    mask: Mask,
    about: Mapping[str, str | float],
    noise: npt.NDArray[np.floating] | None = None,
    layers: Mapping[str, npt.ArrayLike] = MappingProxyType({}),
) -> None:
    """Write a picture (H, W, 3) as an OpenEXR: A = 1 where `mask` is, with the standard error if known.

    Further `layers`, planes by name, are stored as float16.
    """
    channels: dict[str, npt.ArrayLike] = {name: picture[..., i] for i, name in enumerate(RGB)}
    channels["A"] = mask.astype(np.float32)
    if noise is not None:
        channels |= {name: noise[..., i] for i, name in enumerate(ERROR)}
    write_exr(path, channels | dict(layers), dict(about), half=layers)


def _about(fabric: Fabric, scene: View, gbuffer: GBuffer) -> dict[str, str | float]:
    return {"fabric": fabric.name, "scene": scene, "irradiance": float(gbuffer.irradiance.max(initial=0.0))}
