"""Texture maps as files: OpenEXR with floats, and PNG for programs that read nothing else.

| kind | OpenEXR | PNG |
|---|---|---|
| colour | linear RGB, 16-bit floats | sRGB, 8 bits |
| direction | 0.5 + 0.5 w of a unit vector w, 16-bit floats | the same, 8 bits |
| share | numbers from 0 to 1, 16-bit floats | the same, 8 bits |
| height | as it is, 32-bit float | 0 at the lowest, 65535 at the highest |
| number | a whole number, 32-bit float | the same, 16 bits |

Row 0 of an array is the lowest row of the picture.
"""

import io
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
from PIL import Image

from reports.images.exr import write_exr
from reports.images.tiles import encoded

Kind = Literal["colour", "direction", "share", "height", "number"]

_HALF: Final = ("colour", "direction", "share")


def write_texture(path: Path, plane: npt.NDArray[Any], kind: Kind, span: tuple[float, float] = (0.0, 1.0)) -> None:
    """Write a map as `path`.exr and `path`.png, in a folder that exists.

    The plane is (H, W) or (H, W, 3), shares also (H, W, 4); directions are unit vectors. `span` is the lowest and the
    highest of heights.
    """
    values = 0.5 + 0.5 * plane if kind == "direction" else plane
    shown = values[::-1]
    channels = {"Y": shown} if shown.ndim == 2 else {"RGBA"[axis]: shown[..., axis] for axis in range(shown.shape[-1])}
    write_exr(path.with_name(f"{path.name}.exr"), channels, half=channels if kind in _HALF else (), durable=False)
    path.with_name(f"{path.name}.png").write_bytes(png_bytes(values, kind, span))


def png_bytes(values: npt.NDArray[Any], kind: Kind, span: tuple[float, float] = (0.0, 1.0)) -> bytes:
    """Return a map as a PNG, directions as 0.5 + 0.5 w; a fourth channel of a colour is its opacity."""
    shown = values[::-1]
    if kind in ("height", "number"):
        low, high = span if kind == "height" else (0.0, 65535.0)
        share = np.clip((shown - low) / max(high - low, 1e-12), 0.0, 1.0)
        codes: npt.NDArray[Any] = np.rint(65535.0 * share).astype(np.uint16)
    else:
        codes = np.rint(255.0 * np.clip(shown, 0.0, 1.0)).astype(np.uint8)
        if kind == "colour":
            codes[..., :3] = encoded(shown[..., :3])
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(codes)).save(buffer, format="PNG", compress_level=4)
    return buffer.getvalue()
