"""A strip of consecutive frames, one row a method and the truth's on top: flicker and moiré to look at.

All are shown alike: times an exposure, cut at 1, sRGB encoding, the same crop of every frame. A last column, wider
apart, is the slice over time: the crop's middle row of pixels in every frame, the first frame on top. What moves
steadily makes slanted lines there, what flickers breaks them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from reports.images.tiles import EXPOSURE, encoded, png
from weaves.colour import LUMINANCE
from weaves.errors import BadInput

GAP: Final = 2
"""Clear pixels between frames."""
SHOWN: Final = 6
"""Frames of a strip, if there are as many."""

LARGEST: Final = (40, 96)
"""Height and width of the largest crop that `liveliest` chooses, in pixels."""

Bytes8 = npt.NDArray[np.uint8]


class Crop(NamedTuple):
    """A rectangle of pixels, the first row on top."""

    top: int
    left: int
    height: int
    width: int


def filmstrip(
    rows: Mapping[str, npt.ArrayLike], crop: Crop | None = None, count: int = SHOWN, exposure: float = EXPOSURE
) -> bytes:
    """Return frames side by side as PNG bytes, without words.

    Parameters
    ----------
    rows : mapping of array_like (F, H, W) or (F, H, W, 3)
        Linear luminance or RGB of the truth and of methods, all of one size, in the order of the strip's rows.
    crop : Crop, optional
        What is shown of every frame; all of it by default.
    count : int
        Consecutive frames shown, from the first on; fewer if there are fewer.
    exposure : float
        Factor on linear values; times the irradiance where frames are without it (`reports.measure.frames`).

    Raises
    ------
    BadInput
        If there are no frames, their sizes differ, a shown value is not finite, or the crop leaves the frames.
    """
    films = {name: np.asarray(frames) for name, frames in rows.items()}
    crop = _crop(films, crop)
    if count < 1:
        raise BadInput("strip of frames", "count", count, "one frame at least is needed")
    strips = [_strip(name, film[:count], crop, exposure) for name, film in films.items()]
    width = max(strip.shape[1] for strip in strips)
    lines = [np.pad(strip, ((0, GAP), (0, width - strip.shape[1]), (0, 0))) for strip in strips]
    return png(np.concatenate(lines)[:-GAP])


def liveliest(rows: Mapping[str, npt.ArrayLike], largest: tuple[int, int] = LARGEST) -> Crop:
    """Return the rectangle of at most `largest` (height, width) pixels in which most changes from frame to frame.

    The rectangle, of all that lie an eighth of it apart, with the largest sum of the luminance's variance over frames,
    summed over all films: `rows` as in `filmstrip`, in colour. Of equal ones the topmost, then the leftmost.
    """
    change = np.sum([np.var(np.asarray(frames) @ np.array(LUMINANCE), axis=0) for frames in rows.values()], axis=0)
    height, width = (min(sides) for sides in zip(change.shape, largest, strict=True))
    tops, lefts = (
        range(0, whole - side + 1, max(1, side // 8)) for whole, side in zip(change.shape, (height, width), strict=True)
    )
    found = {(top, left): change[top : top + height, left : left + width].sum() for top in tops for left in lefts}
    top, left = max(found, key=lambda place: found[place])
    return Crop(top, left, height, width)


def _crop(films: Mapping[str, npt.NDArray[np.floating]], crop: Crop | None) -> Crop:
    """Return the rectangle that is shown, or say why there is none."""
    size = next((film.shape[1:3] for film in films.values()), ())
    for name, film in films.items():
        if film.ndim - 3 not in (0, 1) or film.shape[1:3] != size or film.shape[3:] not in ((), (3,)) or not film.size:
            raise BadInput("strip of frames", name, film.shape, f"frames of one size are needed, here {size}")
    height, width = size or (0, 0)
    top, left, *_ = crop = crop or Crop(0, 0, height, width)
    if min(top, left) < 0 or min(crop[2:]) < 1 or top + crop.height > height or left + crop.width > width:
        raise BadInput("strip of frames", "crop", tuple(crop), f"a part of the frames' {size} is needed")
    return crop


def _strip(name: str, frames: npt.NDArray[np.floating], crop: Crop, exposure: float) -> Bytes8:
    """Return the crops of frames side by side and the slice over time, RGBA."""
    top, left, height, width = crop
    shown = frames[:, top : top + height, left : left + width]
    if not np.isfinite(shown).all():
        raise BadInput("strip of frames", name, "not finite", "every shown pixel needs a number")
    rgb = shown if shown.ndim == 4 else np.stack([shown] * 3, axis=-1)
    codes = encoded(exposure * rgb)
    opaque = np.concatenate([codes, np.full((*codes.shape[:3], 1), 255, np.uint8)], axis=-1)
    over_time = opaque[np.arange(height) * len(opaque) // height, height // 2]
    clear = np.zeros((height, GAP, 4), np.uint8)
    parts = [part for frame in opaque for part in (frame, clear)]
    return np.concatenate([*parts, clear, clear, over_time], axis=1)
