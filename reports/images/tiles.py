"""Pictures without words: renderings, differences, and maps of the repeat, as PNG bytes.

Renderings are tone mapped alike: times `EXPOSURE`, cut at 1, sRGB encoding (from colour-science, by way of
`weaves.colour`); pixels without cloth are transparent. Every pixel becomes a square of `SCALE`.

Tone curves of renderings of one's own, `EXPOSURE` 2^exposure times brighter, before the sRGB encoding:

    srgb        x cut at 1; as on the page
    reinhard    x / (1 + L), L the luminance: nothing is cut but saturated colours [Reinhard2002Tone, equation 3]
"""

import io
from collections.abc import Sequence
from functools import cache
from typing import Any, Final, Literal

import matplotlib as mpl
import matplotlib.image
import numpy as np
import numpy.typing as npt
from PIL import Image

from reports.images.exr import RGB, Exr
from weaves.colour import EXPOSURE, LUMINANCE, linear_rgb
from weaves.fabric import Fabric
from weaves.surface import GAP, ClothSurface, surface_at

RELATIVE_RANGE: Final = 0.5  # relative difference that is shown in full colour

DIFFERENCE_RANGE: Final = 0.5  # difference, as a share of the truth's mean luminance, that is shown in full colour
SCALE: Final = 2
CELLS: Final = 16  # yarns shown in each direction by the maps of the repeat
CELL_PIXELS: Final = 12

Bytes8 = npt.NDArray[np.uint8]


def picture(exr: Exr) -> bytes:
    """Return a rendering as it is shown."""
    cloth = exr.channels["A"] > 0
    rgb = encoded(EXPOSURE * exr.stack(*RGB))
    return png(np.concatenate([rgb * cloth[..., None], np.where(cloth, 255, 0)[..., None]], axis=-1).astype(np.uint8))


def difference(exr: Exr, truth: Exr) -> bytes:
    """Return luminance minus the truth's: blue too dark, red too bright, in full colour from `DIFFERENCE_RANGE` on."""
    shown, reference = ((e.stack(*RGB).astype(np.float64) @ np.array(LUMINANCE)) for e in (exr, truth))
    cloth = truth.channels["A"] > 0
    scale = DIFFERENCE_RANGE * reference[cloth].mean() if cloth.any() else 1.0
    return _tile("RdBu_r", 0.5 + 0.5 * np.clip((shown - reference) / scale, -1.0, 1.0), cloth)


def relative_tile(differences: Exr) -> bytes:
    """Return the relative difference of luminance: blue too dark, red too bright, full from `RELATIVE_RANGE` on."""
    share = np.clip(differences.channels["relative.Y"] / RELATIVE_RANGE, -1.0, 1.0)
    return _tile("RdBu_r", 0.5 + 0.5 * share, differences.channels["lit"] != 0)


def flip_tile(differences: Exr, channel: str = "flip_ldr") -> bytes:
    """Return a map of FLIP, black to white from 0 to 1 by way of purple and orange, as its authors show it."""
    return _tile("magma", differences.channels[channel], differences.channels["lit"] != 0)


def _tile(colours: str, share: npt.NDArray[np.floating], shown: npt.NDArray[np.bool_]) -> bytes:
    """Return a map in colours, clear where nothing is shown."""
    rgba = np.array(mpl.colormaps[colours](share, bytes=True))
    rgba[~shown] = 0
    return png(rgba)


def height(fabric: Fabric) -> bytes:
    """Return the height map, black to white from the lowest to the highest point; gaps are black."""
    surface = _surface(fabric)
    solid = surface.yarn != GAP
    low, high = surface.height[solid].min(), surface.height[solid].max()
    share = np.where(solid, (surface.height - low) / max(high - low, 1e-12), 0.0)
    return png(mpl.colormaps["bone"](share, bytes=True), 1)


def normals(fabric: Fabric) -> bytes:
    """Return the normal map: (n + 1) / 2 as red, green, blue; gaps are black."""
    surface = _surface(fabric)
    colours = np.where((surface.yarn != GAP)[..., None], 0.5 * surface.normal + 0.5, 0.0)
    return png(opaque(np.rint(255 * colours).astype(np.uint8)), 1)


def hex_colour(linear: Sequence[float]) -> str:
    """Return a linear RGB colour as ``#rrggbb``."""
    return "#" + "".join(f"{value:02x}" for value in encoded(np.asarray(linear)))


def encoded(linear: npt.NDArray[np.floating]) -> Bytes8:
    """Return sRGB codes of linear values, in their shape."""
    codes = np.interp(linear, _levels(), np.arange(256))
    return np.asarray(np.rint(codes), dtype=np.uint8)


@cache
def _levels() -> npt.NDArray[np.float64]:
    """Return the linear value of each of the 256 sRGB codes."""
    return np.array([linear_rgb(f"#{code:02x}{code:02x}{code:02x}")[0] for code in range(256)])


def _surface(fabric: Fabric) -> ClothSurface:
    """Return the surface at the pixels of the maps, the first pick at the bottom."""
    centres = (np.arange(CELLS * CELL_PIXELS) + 0.5) / CELL_PIXELS
    return surface_at(fabric, centres, centres[::-1, None])


def opaque(rgb: Bytes8) -> Bytes8:
    """Return a picture (H, W, 3) with its opacity as a fourth channel, 255 everywhere."""
    return np.concatenate([rgb, np.full((*rgb.shape[:2], 1), 255, np.uint8)], axis=-1)


def png(rgba: Bytes8, scale: int = SCALE) -> bytes:
    """Return a picture, (H, W, 4), as PNG bytes, every pixel a square of `scale`."""
    buffer = io.BytesIO()
    enlarged = rgba.repeat(scale, axis=0).repeat(scale, axis=1)
    metadata: Any = {"Software": None}  # else the bytes change with matplotlib's version
    matplotlib.image.imsave(buffer, enlarged, format="png", metadata=metadata)
    return buffer.getvalue()


def size_of(png: bytes) -> tuple[int, int]:
    """Return width and height of a picture in pixels."""
    return Image.open(io.BytesIO(png)).size


Tone = Literal["srgb", "reinhard"]  # name of a tone curve

STOPS: Final = 20.0  # largest exposure in either direction, in stops


def displayed(linear: npt.NDArray[np.floating], tone: Tone = "srgb", exposure: float = 0.0) -> Bytes8:
    """Return linear RGB (…, 3), at least 0, as sRGB codes; `exposure` counts stops above that of the page."""
    rgb = EXPOSURE * 2.0**exposure * np.asarray(linear, np.float64)
    return encoded(rgb if tone == "srgb" else rgb / (1.0 + (rgb @ np.array(LUMINANCE))[..., None]))
