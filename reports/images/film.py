"""The frames of a film in one OpenEXR: the first is the picture itself, the others are its layers.

Channels: R, G, B of frame 0; ``frame_1.R``, ``frame_1.G``, ``frame_1.B`` and so on, float16. Linear RGB.
"""

from __future__ import annotations

from itertools import count, takewhile
from typing import Any

import numpy as np
import numpy.typing as npt

from reports.images.exr import RGB, Exr


def frame_layers(frames: npt.NDArray[np.floating]) -> dict[str, npt.NDArray[Any]]:
    """Return frames (F, H, W, 3) but the first as planes by name, for `reports.measure.pictures.write_picture`."""
    names = [(index, channel, f"frame_{index}.{name}") for index in range(1, len(frames)) for channel, name in _RGB]
    return {name: frames[index, ..., channel] for index, channel, name in names}


def film(exr: Exr) -> npt.NDArray[np.float32]:
    """Return all frames that a file holds, (F, H, W, 3); the picture alone where it has no layers."""
    further = takewhile(lambda index: f"frame_{index}.R" in exr.channels, count(1))
    layers = [exr.stack(*(f"frame_{index}.{name}" for name in RGB)) for index in further]
    return np.stack([exr.stack(*RGB), *layers])


_RGB = tuple(enumerate(RGB))
