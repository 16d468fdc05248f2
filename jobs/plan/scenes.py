"""The benchmark's tasks on scenes: one that works out the frames, one a method, one that times all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from jobs.plan.dataset import SECONDS_A_POINT, points_a_row
from jobs.plan.task import Task, identity
from jobs.recipe.recipe import ModelRecipe, Recipe
from pipeline import versions
from pipeline.fingerprint import file_sha256
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.sources import files, worn
from weaves.fabric import load_fabric

_LIGHTS = 5.0  # questions a pixel, roughly


def scene_tasks(recipe: Recipe, name: str, trained: Mapping[str, Mapping[str, Task]]) -> Iterator[Task]:
    """Yield the tasks of one scene; `trained` as in `jobs.plan.measurements.bench_tasks`."""
    frames = _frames_task(recipe, name)
    yield frames
    entries = [
        (model, trained.get(model.options.name, {}))
        for model in recipe.models
        if not model.of_one_material or fabrics_of(name) <= set(trained[model.options.name])
    ]
    folders = [(model, _needed(name, model, trainings)) for model, trainings in entries]
    for model, trainings in folders:
        # A setting at a time: what one took is not lost with another, and a new one costs nothing but itself.
        for options in model.options.single():
            yield _method_task(recipe, name, frames, model.model_copy(update={"options": options}), trainings)
    yield _timing_task(recipe, name, frames, folders)


def _frames_task(recipe: Recipe, name: str) -> Task:
    """Return the task that works out the frames with the truth's answers."""
    options = recipe.bench.scenes
    scene = load_scene(name)
    source = [file_sha256(path) for path in files(scene)] or name
    fabrics = worn(scene)
    spec = {
        "versions": [versions.TRUTH, versions.BENCH, versions.SCENES, versions.SCENE_BENCH],
        "source": source,
        "scene": scene.model_dump(mode="json", exclude={"source"}),
        "fabrics": {key: load_fabric(fabric).model_dump(mode="json") for key, fabric in fabrics.items()},
        "options": options.model_dump(mode="json", exclude={"names", "footprint", "image", "display"}),
    }
    stem = f"records/scene-{scene.name}-{identity('bench', spec)[:8]}"
    questions = options.size[0] * options.size[1] * _LIGHTS
    points = points_a_row(options.truth) + (options.frames - 1) * points_a_row(options.frame_truth)
    return Task(
        "bench",
        "truth of the scenes",
        f"truth of the scene {scene.name}",
        spec,
        (f"{stem}.npz", f"{stem}.exr"),
        cost=questions * SECONDS_A_POINT * points,
        size=int(questions * options.frames * 40),
        setting={"make": "shot", "scene": name, "options": recipe.bench.model_dump(mode="json")},
    )


def _method_task(recipe: Recipe, name: str, frames: Task, model: ModelRecipe, trainings: Sequence[Task]) -> Task:
    """Return the measurements of one setting of a model on a scene."""
    options, bench, scene = model.options, recipe.bench, load_scene(name).name
    spec = {
        "measure": [versions.BENCH, versions.SCENE_BENCH, versions.FALLBACK, options.version],
        "frames": frames.id,
        "options": options.model_dump(mode="json"),
        "models": [training.id for training in trainings],
        "bench": bench.model_dump(mode="json", include={"picture_counts"}),
        "scenes": bench.scenes.model_dump(mode="json", exclude={"names"}),
    }
    stem = f"records/{options.name}-{scene}-{identity('bench', spec)[:8]}"
    shown = [f"k = {knob}" for knob in options.knobs if knob in bench.picture_counts] if options.knobs else [""]
    pictures = {setting: f"{stem}{setting.replace(' = ', '').replace('k', '-k')}.exr" for setting in shown}
    questions = bench.scenes.size[0] * bench.scenes.size[1] * _LIGHTS * bench.scenes.frames
    return Task(
        "bench",
        f"{options.name}, scenes",
        " ".join([options.name, *(f"k = {knob}" for knob in options.knobs), f"on the scene {scene}"]),
        spec,
        (f"{stem}.json", f"{stem}.machine.json", *pictures.values()),
        (frames.id, *(training.id for training in trainings)),
        cost=1.0 + questions * options.seconds[1] * (sum(options.knobs) or 1),
        size=len(shown) * bench.scenes.size[0] * bench.scenes.size[1] * (26 + 6 * bench.scenes.frames),
        setting={
            "make": "scene",
            "scene": scene,
            "frames": frames.products[0],
            "pictures_of": pictures,
            "options": bench.model_dump(mode="json"),
            **_model(model, trainings),
        },
    )


def _timing_task(
    recipe: Recipe, name: str, frames: Task, entries: Sequence[tuple[ModelRecipe, Sequence[Task]]]
) -> Task:
    """Return the timing of a frame by all methods; nothing else may run meanwhile."""
    bench, scene = recipe.bench, load_scene(name).name
    spec = {
        "measure": "time of a frame, cloth by cloth",
        "version": [versions.BENCH, versions.FALLBACK],
        "frames": frames.id,
        "options": bench.model_dump(mode="json", include={"timing_repeats", "warm_up"}),
        "scenes": bench.scenes.model_dump(mode="json", include={"seed", "footprint"}),
        "models": [[model.options.version, model.options.model_dump(mode="json")] for model, _ in entries],
        "trainings": [task.id for _, tasks in entries for task in tasks],
    }
    stem = f"records/timing-{scene}-{identity('bench', spec)[:8]}"
    return Task(
        "bench",
        "timing, scenes",
        f"time of a frame of {scene}",
        spec,
        (f"{stem}.json", f"{stem}.machine.json"),
        (frames.id, *(task.id for _, tasks in entries for task in tasks)),
        cost=10.0,
        size=8000,
        setting={
            "make": "frame time",
            "frames": frames.products[0],
            "options": bench.model_dump(mode="json"),
            "methods": [_model(model, trainings) for model, trainings in entries],
        },
        alone=True,
    )


def fabrics_of(name: str) -> set[str]:
    """Return the names of the fabrics that a scene shows."""
    return {load_fabric(fabric).name for fabric in worn(load_scene(name)).values()}


def _needed(name: str, model: ModelRecipe, trainings: Mapping[str, Task]) -> list[Task]:
    """Return the trainings that a model answers a scene with."""
    return (
        [trainings[fabric] for fabric in sorted(fabrics_of(name))] if model.of_one_material else [*trainings.values()]
    )


def _model(model: ModelRecipe, trainings: Sequence[Task]) -> dict[str, Any]:
    """Return what it takes to load a model."""
    folders = [str(Path(task.products[0]).parent) for task in trainings]
    return {"model": model.options.model_dump(mode="json"), "models": folders}
