"""Pictures of a page: views of fabrics and scenes by every method in their order, and strips of consecutive frames.

A strip of frames has one row a method, the truth's on top: flicker and moiré to look at. All are shown alike: times an
exposure, cut at 1, sRGB encoding, the same crop of every frame. A last column, wider apart, is the slice over time: the
crop's middle row of pixels in every frame, the first frame on top. What moves steadily makes slanted lines there, what
flickers breaks them.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt
import pandas as pd

from pipeline.models.added.added_code import ADDED_MODEL
from reports.images.tiles import Bytes8, encoded, png
from reports.page.content import ModelNote, PictureFile
from reports.record import TRUTH
from reports.tables.number_format import beyond_noise, scientific
from reports.tables.summary import BASELINE, rows
from weaves.colour import EXPOSURE, LUMINANCE

FRAME_GAP: Final = 2  # clear pixels between frames
SHOWN: Final = 6  # frames of a strip, if there are as many
MOST_FILMS: Final = 12  # rows of a strip of frames

Crop = tuple[slice, slice]  # rows and columns of a rectangle of pixels


@dataclass(frozen=True)
class Strip:
    """One view of one fabric, or one scene, by every method; the truth first."""

    fabric: str
    scene: str
    cells: list[dict[str, str]] = field(default_factory=list)  # each with `stem`, `method`, `label` and `mse`


def strips(
    pictures: Sequence[PictureFile],
    order: Sequence[str],
    scenes: Sequence[str],
    errors: Sequence[pd.DataFrame],
    methods: Sequence[ModelNote] = (),
) -> list[Strip]:
    """Return the views of the fabrics, then the scenes.

    In each the truth stands first, then the methods from outside, the first picture of each other kind, and the rest.
    Fabrics come in their `order`, then `scenes` (views too) in theirs. The MSE beside a picture is from `errors`:
    `summary.picture_table` and `summary.scene_table`. The notes tell the kinds of the methods.
    """
    kinds = {note.name: note.kind or note.name for note in methods}
    mse = {
        (getattr(row, "fabric", ""), row.scene, row.method, row.setting): row.mse
        for table in errors
        for row in rows(table)
    }
    views: dict[tuple[str, str], Strip] = {}
    for file in sorted(pictures, key=lambda file: (file.method != TRUTH, kinds.get(file.method) != ADDED_MODEL)):
        strip = views.setdefault((file.fabric, file.scene), Strip(file.fabric, file.scene))
        value = mse.get((file.fabric, file.scene, file.method, file.setting), math.nan)
        cell = {"stem": file.stem, "method": file.method, "label": file.label}
        strip.cells.append(cell | {"mse": beyond_noise(value, scientific)})
    for strip in views.values():
        of_cells = [kinds.get(cell["method"], cell["method"]) for cell in strip.cells]
        again = [kind in of_cells[:i] and kind != ADDED_MODEL for i, kind in enumerate(of_cells)]
        strip.cells[:] = [strip.cells[i] for i in np.argsort(again, kind="stable").tolist()]
    fabrics, places = (
        {name: index for index, name in enumerate(names)} for names in (order, list(dict.fromkeys(scenes)))
    )
    return sorted(views.values(), key=lambda s: (fabrics.get(s.fabric, len(fabrics)), places.get(s.scene, len(places))))


def films(pictures: Sequence[PictureFile]) -> dict[str, list[PictureFile]]:
    """Return for each scene the rows of its strip of frames: the truth, then every method once.

    Of a method with several settings the first picture counts: there it aliases most. Of more than `MOST_FILMS` the
    first ones stay, and the baseline.
    """
    result: dict[str, list[PictureFile]] = {}
    pictures = [file for file in pictures if not file.fabric and not file.larger]
    for scene in dict.fromkeys(file.scene for file in pictures):
        own = sorted((f for f in pictures if f.scene == scene), key=lambda f: f.method != TRUTH)
        once = [file for i, file in enumerate(own) if file.method not in {before.method for before in own[:i]}]
        wanted = sorted(once, key=lambda file: file.method != TRUTH and (file.method, file.setting) != BASELINE)
        result[scene] = [file for file in once if file in wanted[:MOST_FILMS]]
    return result


def filmstrip(films: Mapping[str, npt.NDArray[np.floating]]) -> bytes:
    """Return frames side by side as PNG bytes, without words.

    `films` hold frames (F, H, W, 3), linear RGB of the truth and of methods, all of one size, in the order of the
    strip's rows. The first `SHOWN` are shown, in the rectangle in which most changes over all of them (`liveliest`).
    """
    crop = liveliest(films)
    strips = [_strip(frames[:SHOWN], crop) for frames in films.values()]
    width = max(strip.shape[1] for strip in strips)
    lines = [np.pad(strip, ((0, FRAME_GAP), (0, width - strip.shape[1]), (0, 0))) for strip in strips]
    return png(np.concatenate(lines)[:-FRAME_GAP])


def liveliest(films: Mapping[str, npt.NDArray[np.floating]], largest: tuple[int, int] = (40, 96)) -> Crop:
    """Return the rectangle of at most `largest` (height, width) pixels in which most changes from frame to frame.

    The rectangle, of all that lie an eighth of it apart, with the largest sum of the luminance's variance over frames,
    summed over all films. Of equal ones the topmost, then the leftmost.
    """
    change = np.sum([np.var(frames @ np.array(LUMINANCE), axis=0) for frames in films.values()], axis=0)
    height, width = (min(sides) for sides in zip(change.shape, largest, strict=True))
    tops, lefts = (
        range(0, whole - side + 1, max(1, side // 8)) for whole, side in zip(change.shape, (height, width), strict=True)
    )
    sums = {(top, left): change[top : top + height, left : left + width].sum() for top in tops for left in lefts}
    top, left = max(sums, key=lambda place: sums[place])
    return slice(top, top + height), slice(left, left + width)


def _strip(frames: npt.NDArray[np.floating], crop: Crop) -> Bytes8:
    """Return the crops of frames side by side and the slice over time, RGBA."""
    codes = encoded(EXPOSURE * frames[:, *crop])
    height = codes.shape[1]
    opaque = np.pad(codes, ((0, 0), (0, 0), (0, 0), (0, 1)), constant_values=255)
    over_time = opaque[np.arange(height) * len(opaque) // height, height // 2]
    clear = np.zeros((height, FRAME_GAP, 4), np.uint8)
    parts = [part for frame in opaque for part in (frame, clear)]
    return np.concatenate([*parts, clear, clear, over_time], axis=1)
