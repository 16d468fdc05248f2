"""Photographs of flat cloth beside what a fabric predicts: the shape of the streak of light, along it and across it.

A TOML file beside the pictures says where things are, in any one unit of length. The cloth is the plane z = 0, x along
the weft, y along the warp, its front at z > 0:

    [reflection]                                         # or [transmission], or both
    image = "front.png"                                  # sRGB, 8 or 16 bits
    corners = [[0, 0], [10, 0], [10, 10], [0, 10]]       # x, y of lower left, lower right, upper right, upper left
    camera = [5, -20, 30]
    light = [5, 30, 30]                                  # a small lamp; behind the cloth for transmission

A camera maps the plane by a homography, which the corners give. A block of pixels counts as one footprint that covers
the weave evenly. Exposure and lamp are not known, so photograph and prediction are each divided by their mean. Blocks
with a pixel near white are left out. The streak's axes are the principal axes of what the photograph has above its
median.
"""

from pathlib import Path
from typing import Annotated, Final, NamedTuple

import numpy as np
from PIL import Image
from pydantic import Field

from pipeline.bsdf.of_fabric import EVEN_SIGMA
from pipeline.compiled.arrays import Float64
from pipeline.scenes.shade import shade
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.colour import LUMINANCE, decoded
from weaves.errors import BadInput, one_line
from weaves.fabric import Fabric
from weaves.reading import refuse_irregular
from weaves.validation import Frozen, read_toml, validated

_MOST_PIXELS: Final = 50_000_000  # of a picture
_BLOCKS, _STRIPS = 48, 24  # blocks along the longer side of a picture; strips of a profile
_WHITE: Final = 0.98  # of the largest code: brighter pixels may be cut off
_TRUTH: Final = TruthOptions(relative_error=0.02)

Length = Annotated[float, Field(ge=-1e6, le=1e6)]
Corner = tuple[Length, Length]
Place = tuple[Length, Length, Length]


class _Setup(Frozen):
    """Where camera, lamp and the corners of a picture are."""

    image: str
    corners: tuple[Corner, Corner, Corner, Corner]
    camera: Place
    light: Place


class _Setups(Frozen):
    reflection: _Setup | None = None
    transmission: _Setup | None = None


class Photograph(NamedTuple):
    """N blocks of a picture."""

    places: Float64  # on the cloth, (N, 2)
    values: Float64  # linear luminance, of any scale, (N,)
    wi: Float64
    wo: Float64
    """Unit vectors to lamp and camera, (N, 3)."""
    irradiance: Float64  # of a surface that faces the lamp, of any scale, (N,)


class Streak(NamedTuple):
    """A profile of a streak of light, along it or across it."""

    error: float  # RMS difference of photograph and prediction over their mean
    measured: float
    predicted: float
    """Standard deviations of the light above the median, in the file's unit of length."""


def read_photographs(path: Path) -> dict[str, Photograph]:
    """Read the photographs of a file by their kinds; BadInput if one, or its geometry, cannot be used."""
    setups, photographs = validated(_Setups, read_toml(path), str(path)), {}
    for kind, setup in setups:
        if setup:
            behind = kind == "transmission"
            if setup.camera[2] <= 0.0 or (setup.light[2] < 0.0) != behind or setup.light[2] == 0.0:
                side = "behind it, z < 0" if behind else "in front of it, z > 0"
                raise BadInput(str(path), kind, setup.light, f"the camera is in front of the cloth, the light {side}")
            photographs[kind] = _photograph(path, kind, setup)
    if not photographs:
        raise BadInput(str(path), "", "names no photograph", "[reflection], [transmission] or both are needed")
    return photographs


def streaks(fabric: Fabric, photograph: Photograph) -> list[Streak]:
    """Compare a photograph with what a fabric predicts: along the streak and across it."""
    nothing, (wi, wo) = np.zeros(len(photograph.values)), (photograph.wi, photograph.wo)
    queries = Queries.round(nothing, nothing, nothing + max(EVEN_SIGMA, *fabric.weave.repeat), wi, wo)
    answers = shade(fabric, estimate(fabric, queries, _TRUTH, 0).mean, queries) @ LUMINANCE * photograph.irradiance
    measured, predicted = (values / values.mean() for values in (photograph.values, answers))
    above = np.maximum(measured - np.median(measured), 0.0)
    _, axes = np.linalg.eigh(np.cov(photograph.places.T, aweights=above))
    result = []
    for coordinate in (photograph.places @ axes[:, ::-1]).T:
        edges = np.quantile(coordinate, np.linspace(0.0, 1.0, _STRIPS + 1)[1:-1])
        strip = np.searchsorted(edges, coordinate)
        count = np.maximum(np.bincount(strip, minlength=_STRIPS), 1)
        own, other = (np.bincount(strip, values, _STRIPS) / count for values in (measured, predicted))
        error = float(np.sqrt(np.mean((other - own) ** 2)) / own.mean())
        lit = (np.maximum(values - np.median(values), 0.0) for values in (measured, predicted))
        result.append(Streak(error, *(float(np.sqrt(np.cov(coordinate, aweights=weights))) for weights in lit)))
    return result


def _photograph(path: Path, kind: str, setup: _Setup) -> Photograph:
    codes = _codes(path.parent / setup.image)
    rows, columns = codes.shape[:2]
    block = max(1, max(rows, columns) // _BLOCKS)
    codes = codes[: rows // block * block, : columns // block * block]
    blocks = codes.reshape(len(codes) // block, block, -1, block, 3).swapaxes(1, 2).reshape(-1, block * block, 3)
    usable = blocks.max(axis=(1, 2)) <= _WHITE
    row, column = np.indices((len(codes) // block, codes.shape[1] // block)).reshape(2, -1)[:, usable]
    if len(row) < 2 * _STRIPS:
        raise BadInput(str(path), kind, setup.image, "is too bright or too small: most of it must be below white")
    values = (decoded(blocks[usable]) @ LUMINANCE).mean(axis=1)
    x, y, w = _homography(str(path), kind, setup.corners) @ [
        (column + 0.5) * block / columns,
        1.0 - (row + 0.5) * block / rows,
        np.ones(len(row)),
    ]
    places = np.stack([x / w, y / w], axis=-1)
    ways = [np.array(point) - np.column_stack([places, 0.0 * x]) for point in (setup.light, setup.camera)]
    distances = [np.linalg.norm(way, axis=1, keepdims=True) for way in ways]
    wi, wo = (way / distance for way, distance in zip(ways, distances, strict=True))
    return Photograph(places, values, wi, wo, distances[0][:, 0] ** -2)


def _codes(path: Path) -> Float64:
    """Return the codes of a picture, sRGB from 0 to 1, (rows, columns, 3)."""
    refuse_irregular(path, "a picture")
    try:
        with Image.open(path) as image:
            if image.width * image.height > _MOST_PIXELS:
                raise BadInput(str(path), "", f"{image.width} x {image.height} pixels", f"{_MOST_PIXELS:,} at most")
            codes = np.asarray(image if image.mode.startswith("I") else image.convert("RGB"), np.float64)
    except (OSError, ValueError, SyntaxError) as error:
        raise BadInput(str(path), "", "no picture", one_line(error)) from error
    return np.broadcast_to(codes[..., None] / 65535.0, (*codes.shape, 3)) if codes.ndim == 2 else codes / 255.0


def _homography(where: str, kind: str, corners: tuple[Corner, ...]) -> Float64:
    """Return the map from a picture, (0, 0) to (1, 1), to the cloth, in homogeneous coordinates, (3, 3)."""
    rows, values = [], []
    for (s, t), (x, y) in zip(((0, 0), (1, 0), (1, 1), (0, 1)), corners, strict=True):
        rows += [[s, t, 1, 0, 0, 0, -s * x, -t * x], [0, 0, 0, s, t, 1, -s * y, -t * y]]
        values += [x, y]
    try:
        return np.append(np.linalg.solve(np.array(rows, float), values), 1.0).reshape(3, 3)
    except np.linalg.LinAlgError as error:
        raise BadInput(where, f"{kind}.corners", corners, "three corners must not lie on one line") from error
