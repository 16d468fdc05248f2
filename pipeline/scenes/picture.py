"""Pictures of a scene by any method: windows of a frame, answered on several threads, with components as layers.

A pixel is one ray and one footprint, or k stratified rays, k = s^2, whose mean is taken. One ray is enough inside the
cloth, because the footprint is the pixel. It is not enough at silhouettes and at the borders of shadows. The footprints
of k rays are smaller, so that all together have the variance of one pixel's Gaussian, and the cloth is as sharp as with
one ray:

    sigma_k^2 = sigma^2 - (1 - 1/k) / 12     in pixels; the rays' own places have the variance (1 - 1/k) / 12

The frame is cut into windows of at most `QUERIES` queries, so that memory does not grow with its size. Neither the
windows nor the chunks of queries depend on the number of threads, so the bytes do not either.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float32, Float64
from pipeline.fingerprint import fingerprint
from pipeline.scenes.bounces import light_between, seen_light
from pipeline.scenes.frame import SceneFrame, render
from pipeline.scenes.loading import FilmWindow, Loaded
from pipeline.scenes.shade import coloured, compose
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.opacity import coverage
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from pipeline.truth.scattering.thread_colours import component_colours
from weaves.fabric import Fabric

QUERIES: Final = 2**20  # queries of a window, at most; a single pixel may have more
CHUNK: Final = 2**14  # queries that a thread answers at a time
MOST_SAMPLES: Final = 8  # most rays along each side of a pixel
_AHEAD = 3  # windows under way: threads have work while a frame is traced

Plane = Float32  # a picture of some channels, (H, W, channels)

LightBetween = Callable[[Fabric, Queries], Float64]
"""Turns queries into the light of all bounces after the first, as `light_between`."""


class PictureMethod(Protocol):
    """A method that answers any query."""

    def rows(self, fabric: Fabric, queries: Queries, seed: int) -> Float32:
        """Return components and transparency of N queries, (N, 5); a transparency may be NaN: it is queried then."""

    def transparency(self, fabric: Fabric, looks: Queries, seed: int) -> Float32:
        """Return the transparency of N footprints, (N,)."""

    def coverage(self, fabric: Fabric, looks: Queries, seed: int) -> Float32:
        """Return the share of view rays that do not leave curved cloth again, (N,); wo.z may have any sign."""

    def colours(self, fabric: Fabric, queries: Queries, seed: int) -> Float32:
        """Return the colours of the components of N queries, (N, 4, 3)."""


class TruthAnswers:
    """The ground truth."""

    def __init__(self, options: TruthOptions) -> None:
        self._options = options

    def rows(self, fabric: Fabric, queries: Queries, seed: int) -> Float32:
        """Return components and transparency of N queries, (N, 5)."""
        answers = estimate(fabric, queries, self._options, seed)
        return np.concatenate([answers.mean, answers.transparency[:, None]], axis=1)

    def predict(self, fabric: Fabric, queries: Queries, seed: int) -> Float32:
        """Return the components of N queries, (N, 4)."""
        return self.rows(fabric, queries, seed)[:, :4]

    def transparency(self, fabric: Fabric, looks: Queries, seed: int) -> Float32:
        """Return the transparency of N footprints, (N,)."""
        return estimate(fabric, looks, self._options, seed).transparency

    def coverage(self, fabric: Fabric, looks: Queries, seed: int) -> Float32:
        """Return the share of view rays that do not leave curved cloth again, (N,)."""
        return coverage(fabric, looks, self._options, seed)[0]

    def colours(self, fabric: Fabric, queries: Queries, seed: int) -> Float32:
        """Return the colours of the components of N queries, (N, 4, 3): those of their own threads."""
        return component_colours(fabric, queries, self._options, seed).mean.astype(np.float32)


class PicturePart(NamedTuple):
    """A window of a picture, finished."""

    window: FilmWindow
    planes: dict[str, Plane]
    """``rgb`` (H, W, 3); with layers also ``backdrop`` and each of `COMPONENTS`, which sum to it, ``cloth``, the share
    of a pixel that cloth covers, and of one ray ``depth``, ``normal``, ``uv`` and ``sigma`` in yarn spacings, and
    ``fabric``, the number of the cloth in the scene from 1 on."""
    queries: int
    fallback: int  # queries that the fallback answered


def sharpened(loaded: Loaded, side: int) -> Loaded:
    """Return a scene whose footprints are those of `side` by `side` rays a pixel, in its smaller pixels."""
    sigma = loaded.options.pixel_sigma
    variance = max(sigma**2 - (1.0 - 1.0 / side**2) / 12.0, (sigma / side) ** 2)
    return replace(loaded, options=loaded.options.model_copy(update={"pixel_sigma": side * variance**0.5}))


def windows(size: tuple[int, int], queries_a_pixel: int) -> list[FilmWindow]:
    """Return windows that cover a picture, from its top left, of at most `QUERIES` queries each."""
    pixels = max(1, QUERIES // queries_a_pixel)
    width = min(size[0], pixels)
    height = min(size[1], max(1, pixels // width))
    return [
        FilmWindow(left, top, min(width, size[0] - left), min(height, size[1] - top))
        for top in range(0, size[1], height)
        for left in range(0, size[0], width)
    ]


def picture(
    loaded: Loaded,
    answerer: PictureMethod,
    pool: Executor,
    size: tuple[int, int],
    frame: float = 0.0,
    side: int = 1,
    layers: bool = False,
    seed: int = 0,
) -> Iterator[PicturePart]:
    """Yield the windows of a frame; frame 0 is the first, `size` width and height in pixels.

    The threads of `pool` answer the queries. `side` is the number of rays along each side of a pixel, `seed` that of
    methods that draw random numbers. With `layers`, components and what is seen are kept apart. Errors as
    `pipeline.scenes.frame.render`.
    """
    fine, whole = sharpened(loaded, side), (side * size[0], side * size[1])
    parts, names = windows(size, side**2 * (len(loaded.lights) + 1)), (loaded.scene.name, frame, seed)
    fabrics = {key: fabric.in_shades() for key, (_, fabric) in loaded.cloths.items()}
    between = light_between if loaded.options.bounces == "all" else None

    def trace(window: FilmWindow) -> SceneFrame:
        return render(fine, frame, whole, FilmWindow(*(side * edge for edge in window)))

    yield from WindowMaker(fabrics, answerer, pool, names, between, side, layers).made(trace, parts)


@dataclass(frozen=True)
class WindowMaker:
    """Makes the windows of a frame: the threads of `pool` answer their queries.

    `fabrics` are those of its G-buffers by their keys; `names` and the window are the seed of random numbers. `between`
    gives the light of all bounces after the first. `side` and `layers` are as for `picture`.
    """

    fabrics: Mapping[str, Fabric]
    answerer: PictureMethod
    pool: Executor
    names: tuple[object, ...]
    between: LightBetween | None = light_between
    side: int = 1
    layers: bool = False

    def made(self, trace: Callable[[FilmWindow], SceneFrame], parts: Iterable[FilmWindow]) -> Iterator[PicturePart]:
        """Yield windows, each finished, that `trace` turns into queries."""
        under_way: deque[_UnderWay] = deque()
        for window in parts:
            frame = trace(window)
            gbuffers = {key: gbuffer.varied(self.fabrics[key]) for key, gbuffer in frame.gbuffers.items()}
            under_way.append(_UnderWay(self, window, frame._replace(gbuffers=gbuffers)))
            if len(under_way) == _AHEAD:
                yield under_way.popleft().part()
        while under_way:
            yield under_way.popleft().part()


class _UnderWay:
    """A window that has been traced and whose queries are being answered."""

    def __init__(self, maker: WindowMaker, window: FilmWindow, frame: SceneFrame) -> None:
        self._maker, self._window, self._frame = maker, window, frame
        fabrics, answerer, between = maker.fabrics, maker.answerer, maker.between
        queries = {key: gbuffer.queries(fabrics[key].repeat) for key, gbuffer in frame.gbuffers.items()}
        self._asked = {key: self._ask(answerer.rows, key, asked, "query") for key, asked in queries.items()}
        self._colours = {key: self._ask(answerer.colours, key, asked, "colour") for key, asked in queries.items()}
        self._between = {
            key: self._ask(lambda fabric, part, _: between(fabric, part).astype(np.float32), key, asked, "later")
            for key, asked in queries.items()
            if between is not None
        }
        rims = {key: gbuffer.rims(fabrics[key].repeat) for key, gbuffer in frame.gbuffers.items()}
        self._coverage = {key: self._ask(answerer.coverage, key, asked, "rim") for key, asked in rims.items()}

    def part(self) -> PicturePart:
        """Return the finished window, when its queries are answered."""
        frame, side, layers = self._frame, self._maker.side, self._maker.layers
        answers = {key: _gathered(asked, (0, 5)) for key, asked in self._asked.items()}
        colours = {key: _gathered(asked, (0, 4, 3)) for key, asked in self._colours.items()}
        later = {key: seen_light(_gathered(light, (0, 4, 3)), colours[key]) for key, light in self._between.items()}
        through = {key: self._transparency(key, answers[key][:, 4]) for key in answers}
        covered = {key: frame.gbuffers[key].coverage(_gathered(rims, (0,))) for key, rims in self._coverage.items()}
        planes = {"backdrop": frame.backdrop.astype(np.float32)}
        for key, gbuffer in frame.gbuffers.items():
            planes["backdrop"] = compose(gbuffer, 0.0, planes["backdrop"], through[key], covered[key])
        kept = {name: np.arange(4) == index for index, name in enumerate(COMPONENTS)} if layers else {"light": True}
        for name, chosen in kept.items():
            planes[name] = np.zeros(frame.backdrop.shape, np.float32)
            for key, gbuffer in frame.gbuffers.items():
                rgb = coloured(np.where(chosen, answers[key][:, :4], np.float32(0.0)), colours[key])
                if key in later:
                    rgb += np.where(np.broadcast_to(chosen, 4)[2:, None], later[key], 0.0).sum(axis=1)
                planes[name] = compose(gbuffer, rgb, planes[name], coverage=covered[key])
        if layers:
            planes["cloth"] = np.zeros((*frame.backdrop.shape[:2], 1), np.float32)
            for key, gbuffer in frame.gbuffers.items():
                planes["cloth"][gbuffer.mask] = 1.0
                planes["cloth"].reshape(-1)[gbuffer.pixel] = covered[key]
        planes = {name: _mean(plane, side) for name, plane in planes.items()}
        planes["rgb"] = np.sum([planes["backdrop"], *(planes[name] for name in kept)], axis=0)
        if layers:
            middle = slice(side // 2, None, side)  # one of the middle rays of each pixel
            planes |= {name: plane[middle, middle] for name, plane in _seen(frame).items()}
        fallback = sum(int(np.isfinite(values[:, 4]).sum()) for values in answers.values())
        return PicturePart(self._window, planes, sum(map(len, answers.values())), fallback)

    def _transparency(self, key: str, known: Float32) -> Float32:
        """Return the transparency of each place, from any of its queries or a new one; 0 if all behind is dark."""
        gbuffer = self._frame.gbuffers[key]
        result = np.full(len(gbuffer.pixel), np.nan, np.float32)
        answered = np.isfinite(known)
        result[gbuffer.place[answered]] = known[answered]
        behind = self._frame.backdrop.reshape(-1, 3)[gbuffer.pixel].any(axis=1)
        rest = np.flatnonzero(np.isnan(result) & behind)
        looks = gbuffer.looks(self._maker.fabrics[key].repeat).take(rest)
        result[rest] = _gathered(self._ask(self._maker.answerer.transparency, key, looks, "look"), (0,))
        return np.nan_to_num(result, nan=0.0)

    def _ask(
        self, ask: Callable[[Fabric, Queries, int], Float32], key: str, queries: Queries, kind: str
    ) -> list[Future[Float32]]:
        """Send queries to the threads in chunks."""
        asked, maker = [], self._maker
        for start in range(0, len(queries.u), CHUNK):
            seed = int(fingerprint([*maker.names, *self._window, key, kind, start]), 16)
            asked.append(maker.pool.submit(ask, maker.fabrics[key], queries.take(slice(start, start + CHUNK)), seed))
        return asked


def _gathered(asked: Sequence[Future[Float32]], shape: tuple[int, ...]) -> Float32:
    """Return the answers of all chunks; an empty array of this shape if there are none."""
    return np.concatenate([np.empty(shape, np.float32), *(future.result() for future in asked)])


def _seen(frame: SceneFrame) -> dict[str, Plane]:
    """Return what each ray meets: depth, normal, and of cloth the place, the footprint and its number."""
    height, width = frame.backdrop.shape[:2]
    channels = {"fabric": 1, "uv": 2, "sigma": 2}
    planes = {name: np.zeros((height * width, count), np.float32) for name, count in channels.items()}
    for number, gbuffer in enumerate(frame.gbuffers.values(), start=1):
        planes["fabric"][gbuffer.mask.ravel()] = number
        planes["uv"][gbuffer.pixel] = np.stack([gbuffer.u, gbuffer.v], axis=-1)
        planes["sigma"][gbuffer.pixel] = np.stack([gbuffer.sigma, gbuffer.sigma_minor], axis=-1)
    shaped = {name: plane.reshape(height, width, -1) for name, plane in planes.items()}
    return shaped | {"depth": frame.depth[..., None].astype(np.float32), "normal": frame.normal.astype(np.float32)}


def _mean(plane: npt.NDArray[np.generic], side: int) -> Plane:
    """Return the mean over the rays of each pixel."""
    height, width, channels = plane.shape
    rays = plane.reshape(height // side, side, width // side, side, channels)
    return np.asarray(rays.mean(axis=(1, 3), dtype=np.float64).astype(np.float32))
