"""Films as MP4: H.264 by PyAV, an optional library."""

from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from pipeline.atomic import atomic_path
from reports.images.tiles import Bytes8
from weaves.errors import BadInput

QUALITY: Final = "16"  # constant rate factor of H.264: a person sees no loss


def refuse_missing(where: str, key: str, path: Path) -> None:
    """Refuse a film if PyAV is not installed."""
    if find_spec("av") is None:
        allowed = "PyAV is needed for films: pip install 'twillight[video]', or name a folder for numbered pictures"
        raise BadInput(where, key, str(path), allowed)


def write_film(path: Path, frames: Iterable[Bytes8], size: tuple[int, int], rate: int) -> None:
    """Write a film, ending in ``.mp4``, whole or not at all.

    Frames are sRGB codes (H, W, 3) of the `size` width and height, both even; `rate` counts frames a second.
    """
    import av
    from av.video.reformatter import ColorRange, Colorspace

    with atomic_path(path) as temporary, av.open(str(temporary), "w", format="mp4", options=_STABLE) as file:
        stream = file.add_stream("libx264", rate=rate, options={"crf": QUALITY, "threads": "1"})
        stream.width, stream.height, stream.pix_fmt = *size, "yuv420p"
        # Players take these for large pictures; without the marks some take others for small ones.
        stream.codec_context.colorspace, stream.codec_context.color_range = Colorspace.ITU709, ColorRange.MPEG
        for codes in frames:
            frame = av.VideoFrame.from_ndarray(codes, format="rgb24")
            frame = frame.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG)
            file.mux(stream.encode(frame))
        file.mux(stream.encode())


_STABLE: Final = {"fflags": "+bitexact"}
