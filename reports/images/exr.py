"""Pictures as OpenEXR: linear channels, ZIP compression, and what they are as metadata.

Channels are float32; of what is only looked at, float16 holds three digits in half the bytes.

OpenEXR writes non-contiguous arrays silently wrong, so every channel is made contiguous here.

A film is one file: frame 0 is the picture itself, the others are layers with channels ``frame_1.R`` and so on.
"""

import itertools
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import OpenEXR

from pipeline.atomic import atomic_path
from weaves.errors import BadInput

Picture = npt.NDArray[np.float32]

RGB: Final = ("R", "G", "B")  # channels of the colour


class Exr(NamedTuple):
    """Contents of an OpenEXR file."""

    channels: dict[str, Picture]  # each (H, W)
    attributes: dict[str, str | int | float]  # metadata that `write_exr` was given

    def stack(self, *names: str) -> Picture:
        """Return channels as one array, (H, W, len(names))."""
        return np.stack([self.channels[name] for name in names], axis=-1)


def write_exr(
    path: Path,
    channels: Mapping[str, npt.ArrayLike],
    attributes: Mapping[str, str | int | float] | None = None,
    half: Collection[str] = (),
    durable: bool = True,
) -> None:
    """Write a picture, ending in ``.exr``, whole or not at all.

    Channels are planes (H, W) by name, such as ``R``, ``G``, ``B``, ``A``; ``layer.R`` belongs to a layer. Those in
    `half` are stored as float16. Names of attributes may not be those that OpenEXR itself uses. `durable` is as for
    `pipeline.atomic.atomic_path`.
    """
    kinds = {name: np.float16 if name in half else np.float32 for name in channels}
    planes = {name: np.ascontiguousarray(plane, dtype=kinds[name]) for name, plane in channels.items()}
    if len({plane.shape for plane in planes.values()}) != 1 or next(iter(planes.values())).ndim != 2:
        raise ValueError(f"channels must be planes of one size, got { ({n: p.shape for n, p in planes.items()}) }")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **(attributes or {})}
    with atomic_path(path, durable=durable) as temporary, OpenEXR.File(header, planes) as file:
        file.write(str(temporary))


def read_exr(path: Path) -> Exr:
    """Read a picture that `write_exr` wrote; BadInput if there is none."""
    if not path.is_file():
        raise BadInput(str(path), "", "does not exist", "a picture is needed; run the benchmark first")
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: np.array(channel.pixels, np.float32) for name, channel in file.channels().items()}
            attributes = {name: value for name, value in file.header().items() if isinstance(value, str | int | float)}
    except (RuntimeError, ValueError) as error:
        raise BadInput(str(path), "", "cannot be read", "an OpenEXR picture is needed") from error
    return Exr(channels, attributes)


def frame_layers(frames: npt.NDArray[np.floating]) -> dict[str, npt.NDArray[Any]]:
    """Return frames (F, H, W, 3) but the first as planes by name, for `reports.measure.pictures.write_picture`."""
    places = itertools.product(range(1, len(frames)), enumerate(RGB))
    return {f"frame_{index}.{name}": frames[index, ..., channel] for index, (channel, name) in places}


def film(exr: Exr) -> npt.NDArray[np.float32]:
    """Return all frames that a file holds, (F, H, W, 3); the picture alone where it has no layers."""
    further = itertools.takewhile(lambda index: f"frame_{index}.R" in exr.channels, itertools.count(1))
    layers = [exr.stack(*(f"frame_{index}.{name}" for name in RGB)) for index in further]
    return np.stack([exr.stack(*RGB), *layers])
