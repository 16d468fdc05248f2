"""Frames of a scene by a method, made on all cores, and the files that hold them."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import numpy as np
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from jobs.terminal import Terminal
from jobs.verbs.render.look import RenderLook
from pipeline import versions
from pipeline.atomic import atomic_write
from pipeline.cores import cores
from pipeline.models.named import TRUTH
from pipeline.models.network import one_thread
from pipeline.scenes.loading import Loaded
from pipeline.scenes.picture import PictureMethod, PicturePart, Plane, picture
from pipeline.truth.conventions import COMPONENTS
from reports.images.exr import RGB, write_exr
from reports.images.tiles import Bytes8, displayed, png
from reports.images.video import write_film

RATE: Final = 24
"""Frames a second of a film."""

_LAYERS: Final = {"normal": "XYZ", "uv": "UV", "sigma": ("major", "minor")}
_HALF: Final = ("normal", "sigma", "fabric")  # three digits are enough


class FilmMaker:
    """A scene, a method and threads that make frames, with a progress bar while they do."""

    def __init__(
        self, loaded: Loaded, answerer: PictureMethod, size: tuple[int, int], how: RenderLook, count: int
    ) -> None:
        self.size = size
        self._loaded, self._answerer, self._how, self._count = loaded, answerer, how, count
        self._queries = self._fallback = 0
        console = Terminal(stderr=True)
        columns = TextColumn("rendering"), BarColumn(), TimeElapsedColumn(), TextColumn("left"), TimeRemainingColumn()
        self._bars = Progress(*columns, console=console, disable=not console.is_terminal, transient=True)
        self._bar = self._bars.add_task("rendering", total=count * size[0] * size[1])

    def __enter__(self) -> FilmMaker:
        self._pool = ThreadPoolExecutor(cores())
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()
        self._pool.shutdown(cancel_futures=True)

    @property
    def share(self) -> float:
        """Share of the queries that the fallback answered."""
        return self._fallback / max(self._queries, 1)

    def write(self, out: Path, method: str) -> None:
        """Write a picture, a film or a folder of pictures."""
        if out.suffix == ".exr":
            self._write_exr(out, method)
        elif out.suffix == ".mp4":
            write_film(out, map(self._shown, range(self._count)), self.size, RATE)
        elif out.suffix == ".png":
            atomic_write(out, _png(self._shown(0)))
        else:
            for frame in range(self._count):
                atomic_write(out / f"frame-{frame + 1:04}.png", _png(self._shown(frame)))

    def _shown(self, frame: int) -> Bytes8:
        """Return a frame as it is shown."""
        codes = np.zeros((self.size[1], self.size[0], 3), np.uint8)
        for part in self._parts(frame, layers=False):
            codes[_place(part)] = displayed(part.planes["rgb"], self._how.tone, self._how.exposure)
        return codes

    def _write_exr(self, out: Path, method: str) -> None:
        """Write the first frame with its layers."""
        planes: dict[str, Plane] = {}
        for part in self._parts(0, layers=True):
            for name, plane in part.planes.items():
                if name not in planes:
                    planes[name] = np.zeros((self.size[1], self.size[0], plane.shape[-1]), np.float32)
                planes[name][_place(part)] = plane
        channels = {channel: planes["rgb"][..., index] for index, channel in enumerate(RGB)}
        channels |= {"A": planes["cloth"][..., 0], "depth.Z": planes["depth"][..., 0]}
        channels |= {"fabric.id": planes["fabric"][..., 0]}
        for layer, parts in {**dict.fromkeys(("backdrop", *COMPONENTS), RGB), **_LAYERS}.items():
            channels |= {f"{layer}.{name}": planes[layer][..., index] for index, name in enumerate(parts)}
        half = [name for name in channels if name.split(".")[0] in _HALF]
        write_exr(out, channels, self._about(method), half)

    def _about(self, method: str) -> dict[str, str | int | float]:
        """Return what the file says of itself."""
        model = method.partition(":")[0]
        own = f", {model} {versions.MODELS[model]}" if model in versions.MODELS else ""
        fabrics = (f"{number} {fabric.name}" for number, (_, fabric) in enumerate(self._loaded.cloths.values(), 1))
        return {
            "scene": self._loaded.scene.name,
            "method": method,
            "fabrics": ", ".join(fabrics),
            "samples": self._how.side**2,
            "directions": self._how.options.environment_directions,
            "fallback_share": 0.0 if method == TRUTH else self.share,
            "versions": f"truth {versions.TRUTH}, fallback {versions.FALLBACK}, scenes {versions.SCENES}{own}",
        }

    def _parts(self, frame: int, layers: bool) -> Iterator[PicturePart]:
        with one_thread():
            for part in picture(
                self._loaded, self._answerer, self._pool, self.size, float(frame), self._how.side, layers
            ):
                self._queries += part.queries
                self._fallback += part.fallback
                yield part
                self._bars.advance(self._bar, part.window.width * part.window.height)


def _place(part: PicturePart) -> tuple[slice, slice]:
    left, top, width, height = part.window
    return slice(top, top + height), slice(left, left + width)


def _png(codes: Bytes8) -> bytes:
    return png(np.concatenate([codes, np.full((*codes.shape[:2], 1), 255, np.uint8)], axis=-1), 1)
