"""`twillight render`: a scene as a picture, a film, or a folder of pictures, by any method."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from cyclopts import Parameter

from jobs.console import duration
from jobs.terminal import Terminal
from jobs.verbs.parameters import NOTHING, Local, SceneName
from jobs.verbs.render.look import WHERE, RenderLook, look
from pipeline.atomic import refuse_unwritable
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.loading import load
from pipeline.scenes.scene import Cloth, Scene
from pipeline.scenes.sources import worn
from reports.images.video import refuse_missing
from reports.options import ShotOptions
from weaves.errors import BadInput, WorkFailed
from weaves.fabric import load_fabric

if TYPE_CHECKING:
    from jobs.verbs.render.film_maker import FilmMaker

MOST_FRAMES: Final = 100_000
"""Most frames of a film."""

_SUFFIXES: Final = (".png", ".exr", ".mp4", "")


def render(
    scene: SceneName,
    *,
    out: Annotated[Local, Parameter(help="File ending in .png, .exr or .mp4, or a folder for numbered pictures.")],
    fabric: Annotated[list[str], Parameter(help="Fabric in place of the next cloth's own; several.")] = NOTHING,
    method: Annotated[str, Parameter(help="truth, selvage, soft_nodes, point_sampled:16, … or a folder.")] = "selvage",
    size: Annotated[str, Parameter(help="WIDTHxHEIGHT in pixels; default: the film of the scene.")] = "",
    frames: Annotated[int | None, Parameter(help="Frames of a film or folder; default: the scene's.")] = None,
    samples: Annotated[int, Parameter(help="Rays a pixel: 1, 4, 9, … 64; more smooth silhouettes.")] = 1,
    directions: Annotated[int, Parameter(help="Directions that an environment light is replaced by.")] = 8,
    tone: Annotated[Literal["srgb", "reinhard"], Parameter(help="Tone curve; srgb cuts at 1.")] = "srgb",
    exposure: Annotated[float, Parameter(help="Exposure in stops; 0: that of the page.")] = 0.0,
) -> None:
    """Render a scene and print where the picture is.

    Raises
    ------
    BadInput
        If a value, the scene, a fabric, the method or the path cannot be used.
    WorkFailed
        If the memory does not suffice.
    """
    how = look(size, samples, directions, tone, exposure)
    found = dressed(load_scene(scene), fabric)
    start = time.monotonic()
    maker = make(found, method, _frames(frames, found, out), how, out)
    width, height = maker.size
    share = "" if method == "truth" else f"; {maker.share:.0%} of the queries by the fallback"
    Terminal().print(f"{out}: {width} x {height}, {duration(time.monotonic() - start)}{share}", soft_wrap=True)


def make(scene: Scene, method: str, frames: int, how: RenderLook, out: Path) -> FilmMaker:
    """Make a picture, a film or a folder, and return what made it; errors as for `render`."""
    # Torch, which help need not wait for.
    from jobs.verbs.render.film_maker import FilmMaker
    from pipeline.models.fallback import Fallback
    from pipeline.models.named import TRUTH, named_method
    from pipeline.scenes.picture import TruthAnswers

    answerer = TruthAnswers(ShotOptions().truth) if method == TRUTH else named_method(method, WHERE, "--method")
    loaded = load(scene, how.options)
    if isinstance(answerer, Fallback):
        for _, fabric in loaded.cloths.values():
            if not answerer.covers(fabric):
                raise BadInput(WHERE, "--method", method, f"this model was not trained on {fabric.name}")
            answerer.prepare(fabric)
    size = how.size or loaded.camera.size
    if out.suffix == ".mp4" and (size[0] % 2 or size[1] % 2):
        raise BadInput(WHERE, "--size", f"{size[0]}x{size[1]}", "both sides of a film must be even")
    refuse_unwritable(out if out.suffix else out / "frame")
    try:
        with FilmMaker(loaded, answerer, size, how, frames) as maker:
            maker.write(out, method)
    except KeyboardInterrupt as stop:
        kept = f"{out} is as it was before" if out.suffix else f"finished frames are in {out}"
        stop.args = (f"stopped; {kept}",)
        raise
    except MemoryError as error:
        raise WorkFailed(f"{out}: the memory does not suffice for {size[0]} x {size[1]} pixels") from error
    return maker


def dressed(scene: Scene, fabrics: Sequence[str]) -> Scene:
    """Return a scene whose cloths are made of other fabrics, in their order; the rest keeps its own."""
    keys = list(worn(scene))
    if len(fabrics) > len(keys):
        allowed = f"the scene {scene.name} has {len(keys)}: {', '.join(keys) or 'none'}"
        raise BadInput(WHERE, "--fabric", fabrics[len(keys)], f"is one fabric more than cloths; {allowed}")
    cloths = dict(scene.cloths)
    for key, name in zip(keys, fabrics, strict=False):
        load_fabric(name)
        cloths[key] = cloths.get(key, Cloth()).model_copy(update={"fabric": name})
    return scene.model_copy(update={"cloths": cloths})


def _frames(frames: int | None, scene: Scene, out: Path) -> int:
    """Return the number of frames; BadInput if it does not go with the file."""
    if out.suffix not in _SUFFIXES:
        raise BadInput(WHERE, "--out", str(out), "must end in .png, .exr or .mp4, or be a folder without a suffix")
    if frames is not None and not 1 <= frames <= MOST_FRAMES:
        raise BadInput(WHERE, "--frames", frames, f"must be from 1 to {MOST_FRAMES}")
    if out.suffix == ".mp4":
        refuse_missing(WHERE, "--out", out)
    if out.suffix in (".png", ".exr"):
        if frames is not None and frames > 1:
            raise BadInput(WHERE, "--frames", frames, f"{out.suffix} holds one frame; name an .mp4 file or a folder")
        return 1
    return scene.frames if frames is None else frames
