"""`twillight render`: a scene as a picture, a film, or a folder of pictures, by any method."""

import re
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from cyclopts import Parameter

from jobs.terminal import duration, print_lines, progress
from jobs.verbs.parameters import NOTHING, Local, SceneName, Whole, named_flags
from pipeline import versions
from pipeline.atomic import atomic_write, refuse_unwritable
from pipeline.cores import cores
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.loading import MOST_PIXELS, Loaded, load
from pipeline.scenes.options import BOUNCES, Bounces, SceneOptions
from pipeline.scenes.picture import MOST_SAMPLES, PictureMethod, PicturePart, Plane, TruthAnswers, picture
from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.sources import worn
from pipeline.truth.conventions import COMPONENTS
from reports.images.exr import RGB, write_exr
from reports.images.tiles import STOPS, Bytes8, Tone, displayed, opaque, png, write_film
from reports.options import ShotOptions
from weaves.errors import BadInput, WorkFailed
from weaves.fabric import load_fabric
from weaves.validation import validated

_WHERE: Final = "render"
_MOST_FRAMES: Final = 100_000
_LAYERS: Final = {"normal": "XYZ", "uv": "UV", "sigma": ("major", "minor")}
_HALF: Final = ("normal", "sigma", "fabric")  # three digits are enough


def size_of(size: str, where: str) -> tuple[int, int]:
    """Return width and height of a picture from the command line; BadInput if they cannot be used."""
    sides = re.fullmatch(r"([0-9]{1,9})x([0-9]{1,9})", size)
    film = (int(sides[1]), int(sides[2])) if sides else (0, 0)
    if not 1 <= min(film) <= max(film) <= MOST_PIXELS:
        raise BadInput(where, "--size", size, f"must be WIDTHxHEIGHT, such as 1024x1024, each from 1 to {MOST_PIXELS}")
    return film


def render(
    scene: SceneName,
    *,
    out: Annotated[Local, Parameter(help="File ending in .png, .exr or .mp4, or a folder for numbered pictures.")],
    fabric: Annotated[list[str], Parameter(help="Fabric in place of the next cloth's own; several.")] = NOTHING,
    method: Annotated[str, Parameter(help="truth, selvage, soft_nodes, point_sampled:16, … or a folder.")] = "selvage",
    size: Annotated[str, Parameter(help="WIDTHxHEIGHT in pixels; default: the film of the scene.")] = "",
    frames: Annotated[Whole | None, Parameter(help="Frames of a film or folder; default: the scene's.")] = None,
    samples: Annotated[Whole, Parameter(help="Rays a pixel: 1, 4, 9, … 64; more smooth silhouettes.")] = 1,
    directions: Annotated[Whole, Parameter(help="Directions that an environment light is replaced by.")] = 8,
    bounces: Annotated[Bounces, Parameter(help="Bounces of light between yarns.")] = BOUNCES,
    tone: Annotated[Literal["srgb", "reinhard"], Parameter(help="Tone curve; srgb cuts at 1.")] = "srgb",
    exposure: Annotated[float, Parameter(help="Exposure in stops; 0: that of the page.")] = 0.0,
) -> None:
    """Render a scene and print where the picture is.

    BadInput if a value, the scene, a fabric, the method or the path cannot be used; WorkFailed if memory is short.
    """
    if samples not in (squares := [side**2 for side in range(1, MOST_SAMPLES + 1)]):
        raise BadInput(_WHERE, "--samples", samples, f"must be one of {', '.join(map(str, squares))}")
    with named_flags(_WHERE, _WHERE, environment_directions="directions"):
        options = validated(SceneOptions, {"environment_directions": directions, "bounces": bounces}, _WHERE)
    if not -STOPS <= exposure <= STOPS:
        raise BadInput(_WHERE, "--exposure", exposure, f"must be from {-STOPS:g} to {STOPS:g} stops")
    chosen_size = size_of(size, _WHERE) if size else None
    dressed = _dressed(load_scene(scene), fabric)
    start = time.monotonic()
    count = _frames(frames, dressed, out)
    loaded, answerer = _loaded(dressed, options, method, out)
    film = _Film(loaded, answerer, chosen_size or loaded.camera.size, round(samples**0.5), tone, exposure, count)
    film.make(out, method)
    width, height = film.size
    share = "" if method == "truth" else f"; {film.share:.0%} of the queries by the fallback"
    print_lines(f"{out}: {width} x {height}, {duration(time.monotonic() - start)}{share}")


def _loaded(scene: Scene, options: SceneOptions, method: str, out: Path) -> tuple[Loaded, PictureMethod]:
    # Torch, which help need not wait for.
    from pipeline.models.fallback import Fallback
    from pipeline.models.named import TRUTH, named_method

    answerer = TruthAnswers(ShotOptions().truth) if method == TRUTH else named_method(method, _WHERE, "--method")
    loaded = load(scene, options)
    refuse_unwritable(out if out.suffix else out / "frame")
    if isinstance(answerer, Fallback):
        for _, fabric in loaded.cloths.values():
            if not answerer.covers(fabric):
                raise BadInput(_WHERE, "--method", method, f"this model was not trained on {fabric.name}")
            answerer.prepare(fabric)
    return loaded, answerer


def _dressed(scene: Scene, fabrics: Sequence[str]) -> Scene:
    """Return a scene whose cloths are made of other fabrics, in their order; the rest keeps its own."""
    keys = list(worn(scene))
    if len(fabrics) > len(keys):
        allowed = f"the scene {scene.name} has {len(keys)}: {', '.join(keys) or 'none'}"
        raise BadInput(_WHERE, "--fabric", fabrics[len(keys)], f"is one fabric more than cloths; {allowed}")
    cloths = dict(scene.cloths)
    for key, name in zip(keys, fabrics, strict=False):
        load_fabric(name)
        cloths[key] = cloths.get(key, Cloth()).model_copy(update={"fabric": name})
    return scene.model_copy(update={"cloths": cloths})


def _frames(frames: int | None, scene: Scene, out: Path) -> int:
    """Return the number of frames; BadInput if it does not go with the file."""
    if out.suffix not in (".png", ".exr", ".mp4", ""):
        raise BadInput(_WHERE, "--out", str(out), "must end in .png, .exr or .mp4, or be a folder without a suffix")
    if frames is not None and not 1 <= frames <= _MOST_FRAMES:
        raise BadInput(_WHERE, "--frames", frames, f"must be from 1 to {_MOST_FRAMES}")
    if out.suffix == ".mp4" and find_spec("av") is None:
        allowed = "PyAV is needed for films: pip install 'twillight[video]', or name a folder for numbered pictures"
        raise BadInput(_WHERE, "--out", str(out), allowed)
    if out.suffix in (".png", ".exr"):
        if frames is not None and frames > 1:
            raise BadInput(_WHERE, "--frames", frames, f"{out.suffix} holds one frame; name an .mp4 file or a folder")
        return 1
    return scene.frames if frames is None else frames


@dataclass
class _Film:
    """A scene, a method, and threads that make frames by it."""

    loaded: Loaded
    answerer: PictureMethod
    size: tuple[int, int]
    side: int  # rays along each side of a pixel
    tone: Tone
    exposure: float  # stops above that of the page
    count: int  # frames
    # So far; those of the queries that the fallback answered.
    queries: int = 0
    fallback: int = 0
    pixels: int = 0

    @property
    def share(self) -> float:
        """Share of the queries that the fallback answered."""
        return self.fallback / max(self.queries, 1)

    def make(self, out: Path, method: str) -> None:
        """Make a picture, a film or a folder; errors as for `render`."""
        width, height = self.size
        if out.suffix == ".mp4" and (width % 2 or height % 2):
            raise BadInput(_WHERE, "--size", f"{width}x{height}", "both sides of a film must be even")
        self._pool = ThreadPoolExecutor(cores())
        try:
            with progress("rendering") as self._advance:
                if out.suffix == ".exr":
                    self._write_exr(out, method)
                elif out.suffix == ".mp4":
                    write_film(out, map(self._shown, range(self.count)), self.size)
                else:
                    for frame in range(self.count):
                        path = out if out.suffix else out / f"frame-{frame + 1:04}.png"
                        atomic_write(path, png(opaque(self._shown(frame)), 1))
        except KeyboardInterrupt as stop:
            kept = f"{out} is as it was before" if out.suffix else f"finished frames are in {out}"
            stop.args = (f"stopped; {kept}",)
            raise
        except MemoryError as error:
            raise WorkFailed(f"{out}: the memory does not suffice for {width} x {height} pixels") from error
        finally:
            self._pool.shutdown(cancel_futures=True)

    def _shown(self, frame: int) -> Bytes8:
        codes = np.zeros((self.size[1], self.size[0], 3), np.uint8)
        for part in self._parts(frame, layers=False):
            codes[shown_at(part)] = displayed(part.planes["rgb"], self.tone, self.exposure)
        return codes

    def _write_exr(self, out: Path, method: str) -> None:
        planes: dict[str, Plane] = {}
        for part in self._parts(0, layers=True):
            for name, plane in part.planes.items():
                if name not in planes:
                    planes[name] = np.zeros((self.size[1], self.size[0], plane.shape[-1]), np.float32)
                planes[name][shown_at(part)] = plane
        channels = {channel: planes["rgb"][..., index] for index, channel in enumerate(RGB)}
        flat = {"A": "cloth", "depth.Z": "depth", "fabric.id": "fabric"}
        channels |= {name: planes[layer][..., 0] for name, layer in flat.items()}
        for layer, parts in {**dict.fromkeys(("backdrop", *COMPONENTS), RGB), **_LAYERS}.items():
            channels |= {f"{layer}.{name}": planes[layer][..., index] for index, name in enumerate(parts)}
        half = [name for name in channels if name.split(".")[0] in _HALF]
        write_exr(out, channels, self._about(method), half)

    def _about(self, method: str) -> dict[str, str | int | float]:
        model = method.partition(":")[0]
        own = f", {model} {versions.MODELS[model]}" if model in versions.MODELS else ""
        fabrics = (f"{number} {fabric.name}" for number, (_, fabric) in enumerate(self.loaded.cloths.values(), 1))
        return {
            "scene": self.loaded.scene.name,
            "method": method,
            "fabrics": ", ".join(fabrics),
            "samples": self.side**2,
            "directions": self.loaded.options.environment_directions,
            "bounces": self.loaded.options.bounces,
            "fallback_share": 0.0 if isinstance(self.answerer, TruthAnswers) else self.share,
            "versions": f"truth {versions.TRUTH}, fallback {versions.FALLBACK}, scenes {versions.SCENES}{own}",
        }

    def _parts(self, frame: int, layers: bool) -> Iterator[PicturePart]:
        from pipeline.models.network import one_thread  # torch

        with one_thread():
            for part in picture(self.loaded, self.answerer, self._pool, self.size, float(frame), self.side, layers):
                self.queries += part.queries
                self.fallback += part.fallback
                yield part
                self.pixels += part.window.width * part.window.height
                self._advance(self.pixels / (self.count * self.size[0] * self.size[1]))


def shown_at(part: PicturePart) -> tuple[slice, slice]:
    """Return where a window is in its picture."""
    left, top, width, height = part.window
    return slice(top, top + height), slice(left, left + width)
