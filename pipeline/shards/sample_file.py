"""Files of measured samples: a place on a patch of cloth, a light, a viewer, and the RGB that was measured.

Samples come as a table, Parquet or CSV, whose rows have any order and any number, or as a folder of pictures:

    u, v              place on the patch, as shares of its sides, [0, 1)
    wi_x .. wo_z      unit vectors to light and viewer, in front of the cloth
    red, green, blue  linear RGB of the patch BSDF in 1/sr, with the incident cosine inside (pipeline.truth.conventions)

A folder has ``directions.csv`` with the column `file` beside those of light and viewer, and in each file an OpenEXR
picture of the patch, a pixel a texel; the top row of a picture has the largest v.
"""

import csv
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import OpenEXR

from pipeline.compiled.arrays import Float32
from pipeline.shards.entry_files import RGB_COLUMNS, read_numbers
from weaves.errors import BadInput, one_line
from weaves.reading import MIB, read_text, refuse_irregular

LIST_FILE: Final = "directions.csv"

_PLACE: Final = ("u", "v")
_VECTORS: Final = tuple(f"{name}_{axis}" for name in ("wi", "wo") for axis in "xyz")
_MOST_ROWS: Final = 2**25  # samples: 2 GB in memory
_MOST_TEXELS: Final = 2**20  # whose latents are at most 128 MB
_MOST_PICTURES: Final = 2**16
_EDGE: Final = 1e-4  # of a texel, by which rounding may put a place on its edge into the one before
_LENGTH: Final = 1e-3  # by which a direction may differ from a unit vector
_BRIGHTEST: Final = 2.0  # most times as bright as white cloth that samples may be


class MeasuredSamples(NamedTuple):
    """N samples of the texels of a patch."""

    shape: tuple[int, int]  # rows and columns of texels; row 0 has the smallest v
    texel: npt.NDArray[np.int64]  # row times columns plus column, (N,)
    wi: Float32
    wo: Float32
    """Unit vectors to light and viewer, (N, 3)."""
    rgb: Float32  # (N, 3)


def read_samples(path: Path, texels: tuple[int, int] | None = None) -> MeasuredSamples:
    """Read samples; a table needs the columns and rows of `texels`, a folder has those of its pictures.

    BadInput for the first fault: what is missing or cannot be read, a place off the patch, a direction that is no unit
    vector or is below the cloth, a value that is negative or not finite, values in another unit, a texel without a
    sample.
    """
    if path.is_dir():
        if texels is not None:
            raise BadInput(str(path), "texels", f"{texels[0]}x{texels[1]}", "leave it out: pictures have their pixels")
        return _refuse_bad(path, _read_pictures(path))
    if texels is None:
        raise BadInput(str(path), "texels", None, "a table needs the number of texels, such as 64x64")
    columns, rows = texels
    _refuse_many(path, rows * columns, _MOST_TEXELS, "texels")
    given = read_numbers(path, _columns, _MOST_ROWS, f"at most {_MOST_ROWS:,} samples are read")
    cells = []
    for name, count in zip(_PLACE, texels, strict=True):
        place = given[name]
        _refuse(path, ~((place >= 0.0) & (place < 1.0)), name, place, "must be in [0, 1): a share of the patch's side")
        cells.append(np.minimum((place * count + _EDGE).astype(np.int64), count - 1))
    with np.errstate(over="ignore", under="ignore"):
        vectors = np.stack([given[name] for name in _VECTORS], axis=-1).astype(np.float32)
        rgb = np.stack([given[name] for name in RGB_COLUMNS], axis=-1).astype(np.float32)
    samples = MeasuredSamples((rows, columns), cells[1] * columns + cells[0], vectors[:, :3], vectors[:, 3:], rgb)
    return _refuse_bad(path, samples)


def _columns(path: Path, names: Sequence[str]) -> list[str]:
    wanted = [*_PLACE, *_VECTORS, *RGB_COLUMNS]
    for name in wanted:
        if (times := Counter(names)[name]) != 1:
            what = "is there more than once" if times else "is missing"
            raise BadInput(str(path), "column", name, f"{what}; needed are {', '.join(wanted)}")
    return wanted


def _read_pictures(folder: Path) -> MeasuredSamples:
    path, needed = folder / LIST_FILE, f"a table with the columns file, {', '.join(_VECTORS)} is needed"
    try:
        text = read_text(path, 16 * MIB, "a table of directions").removeprefix("\ufeff")
        listed = list(csv.DictReader(text.splitlines(), skipinitialspace=True))
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "does not exist", needed) from error
    except csv.Error as error:
        raise BadInput(str(path), "", f"cannot be read ({one_line(error, 80)})", needed) from error
    _refuse_many(path, len(listed), _MOST_PICTURES, "pictures")
    vectors = np.empty((len(listed), 6), np.float32)
    for number, row in enumerate(listed):
        try:
            vectors[number] = [float(row[name]) for name in _VECTORS]
            name = str(row["file"])
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise BadInput(str(path), f"row {number}", one_line(error, 80), needed) from error
        if Path(name).name != name:
            raise BadInput(str(path), f"row {number}, column file", name, "must be a file of the same folder")
    _refuse_directions(path, vectors[:, :3], vectors[:, 3:])
    pictures: list[Float32] = []
    for row in listed:
        picture = _read_picture(folder / row["file"])
        if pictures and picture.shape != pictures[0].shape:
            (height, width, _), size = pictures[0].shape, f"{picture.shape[1]} x {picture.shape[0]}"
            raise BadInput(str(folder / row["file"]), "size", size, f"must be {width} x {height} as others")
        texels = picture.shape[0] * picture.shape[1]
        _refuse_many(folder, texels, _MOST_TEXELS, "texels")
        _refuse_many(folder, texels * len(listed), _MOST_ROWS, "samples")
        pictures.append(picture[::-1])
    rows, columns, _ = pictures[0].shape
    wi, wo = (np.repeat(part, rows * columns, axis=0) for part in (vectors[:, :3], vectors[:, 3:]))
    texel = np.tile(np.arange(rows * columns), len(listed))
    return MeasuredSamples((rows, columns), texel, wi, wo, np.reshape(pictures, (-1, 3)))


def _read_picture(path: Path) -> Float32:
    """Return linear RGB (H, W, 3)."""
    needed = "an OpenEXR picture with R, G and B"
    refuse_irregular(path, needed)
    if not path.exists():
        raise BadInput(str(path), "", "does not exist", f"{needed} is needed")
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            return np.stack([np.asarray(channels[name].pixels, np.float32) for name in "RGB"], axis=-1)
    except (RuntimeError, KeyError, ValueError, OSError) as error:
        raise BadInput(str(path), "", "cannot be read", f"{needed} is needed") from error


def _refuse_many(path: Path, count: int, most: int, what: str) -> None:
    if not 1 <= count <= most:
        raise BadInput(str(path), what, f"{count:,}", f"must be 1 to {most:,}")


def _refuse_directions(path: Path, wi: Float32, wo: Float32) -> None:
    for name, vectors in (("wi", wi), ("wo", wo)):
        with np.errstate(over="ignore", invalid="ignore"):
            length = np.linalg.norm(vectors, axis=1)
        _refuse(path, ~(np.abs(length - 1.0) <= _LENGTH), name, vectors, "must be a unit vector")
        _refuse(path, vectors[:, 2] <= 0.0, name, vectors, "must point to the front of the cloth: z > 0")


def _refuse_bad(path: Path, samples: MeasuredSamples) -> MeasuredSamples:
    """Return samples that all can be used; BadInput for the first that cannot."""
    _refuse_many(path, len(samples.texel), _MOST_ROWS, "samples")
    _refuse_directions(path, samples.wi, samples.wo)
    good = (np.isfinite(samples.rgb) & (samples.rgb >= 0.0)).all(axis=1)
    _refuse(path, np.asarray(~good), ", ".join(RGB_COLUMNS), samples.rgb, "must be finite and at least 0")
    bright = float(np.pi * samples.rgb.mean(dtype=np.float64) / samples.wi[:, 2].mean(dtype=np.float64))
    if bright > _BRIGHTEST:
        allowed = f"at most {_BRIGHTEST:g} (white has 1): values are in 1/sr with the incident cosine"
        raise BadInput(str(path), "pi times the mean of RGB over that of wi_z", f"{bright:.3g}", allowed)
    texels = samples.shape[0] * samples.shape[1]
    empty = np.flatnonzero(np.bincount(samples.texel, minlength=texels) == 0)
    if empty.size:
        row, column = divmod(int(empty[0]), samples.shape[1])
        allowed = f"{empty.size:,} of {texels:,} texels have no sample: each needs one, or take fewer texels"
        raise BadInput(str(path), "texel", f"row {row}, column {column}", allowed)
    return samples


def _refuse(path: Path, bad: npt.NDArray[np.bool_], column: str, values: npt.NDArray[Any], allowed: str) -> None:
    if rows := int(bad.sum()):
        row = int(bad.argmax())
        more = f" ({rows - 1:,} more bad rows)" if rows > 1 else ""
        raise BadInput(str(path), f"row {row}, column {column}", values[row].tolist(), allowed + more)
