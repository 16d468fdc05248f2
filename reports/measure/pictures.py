"""Pictures of the views, by the truth and by methods, and the errors of methods.

A picture is a linear OpenEXR: R, G, B under the light of the view, A = 1 where there is cloth. The truth's holds the
standard error of each colour too, and the light of later bounces, which pictures of methods take from it.
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
from pipeline.scenes.bounces import later_bounces
from pipeline.scenes.gbuffer import GBuffer
from pipeline.scenes.options import View
from pipeline.scenes.shade import coloured, colours_of, compose
from pipeline.scenes.views import view
from pipeline.truth.estimator import estimate
from pipeline.truth.scattering.thread_colours import component_colours
from reports.error import colour_noise, squared_error
from reports.images.exr import RGB, read_exr, write_exr
from reports.options import PictureOptions
from reports.record import TRUTH, Record
from weaves.fabric import Fabric

ERROR: Final = ("error.R", "error.G", "error.B")  # channels of its standard error
_LATER = ("later.R", "later.G", "later.B")  # of the bounces after the first


def render_truth(fabric: Fabric, scene: View, options: PictureOptions, path: Path) -> None:
    """Write the truth's picture of a scene to `path`."""
    gbuffer = view(scene, *options.size(scene), options=options.view)
    seed = int(fingerprint(["truth", fabric.name, scene, options.seed]), 16)
    queries = gbuffer.queries(fabric.repeat)
    answers = estimate(fabric, queries, options.truth, seed)
    colours = component_colours(fabric, queries, options.truth, seed).mean
    noise = compose(gbuffer, colour_noise(answers, colours))
    later = compose(gbuffer, later_bounces(fabric, queries, colours).sum(axis=1))
    picture = compose(gbuffer, coloured(answers.mean, colours)) + later
    about = {**_about(fabric, scene, gbuffer), "method": TRUTH}
    write_picture(path, picture, gbuffer.mask, about, noise, later=later)


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
    reference, components = read_exr(truth), method.predict(fabric, queries, seed)
    picture = compose(gbuffer, coloured(components, colours_of(fabric, queries))) + reference.stack(*_LATER)
    about = {**_about(fabric, scene, gbuffer), "method": method.name, "setting": method.setting}
    write_picture(path, picture, gbuffer.mask, about)
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
    later: npt.NDArray[np.floating] | None = None,
) -> None:
    """Write a picture (H, W, 3) as an OpenEXR: A = 1 where `mask` is.

    Beside it are the standard error and the light of later bounces if given, and further `layers`, planes by name,
    which are stored as float16.
    """
    channels: dict[str, npt.ArrayLike] = {"A": mask.astype(np.float32), **layers}
    for names, values in ((RGB, picture), (ERROR, noise), (_LATER, later)):
        channels |= {} if values is None else {name: values[..., i] for i, name in enumerate(names)}
    write_exr(path, channels, dict(about), half=layers)


def _about(fabric: Fabric, scene: View, gbuffer: GBuffer) -> dict[str, str | float]:
    return {"fabric": fabric.name, "scene": scene, "irradiance": float(gbuffer.irradiance.max(initial=0.0))}
