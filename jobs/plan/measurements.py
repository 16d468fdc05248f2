"""The benchmark's tasks: the truth's pictures, one task a method and fabric, latents, the timing of all methods.

The truth of a picture depends on fabric and view alone, so every recipe and every model shares it. Colours enter here:
errors and pictures are of light, not of components.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jobs.plan.dataset import SECONDS_A_POINT, Shard, fingerprint_of, folder_of, points_a_row
from jobs.plan.scenes import scene_tasks
from jobs.plan.task import Task, identity
from jobs.recipe.recipe import ModelRecipe, Recipe
from pipeline import versions
from pipeline.fingerprint import fingerprint
from pipeline.models.domain import PHYSICS
from pipeline.truth.options import TruthOptions
from reports.options import LATENT_PAIRS, BenchOptions
from weaves.fabric import Fabric, load_fabric

_TIMED = {"timing_rows", "timing_repeats", "warm_up", "threads"}  # options of the timing alone


@dataclass(frozen=True)
class Subject:
    """A named fabric, its role, and the tasks whose products its measurements read."""

    fabric: Fabric
    role: str
    test: tuple[str, ...]
    pictures: Mapping[str, Task]
    frames: Task
    edge: Task | None

    @property
    def truth(self) -> dict[str, str]:
        """Paths of the truth's pictures by scene, of its frames, and of its edge where the cloth is curved."""
        return {name: task.products[0] for name, task in self._shown.items()}

    @property
    def needs(self) -> tuple[str, ...]:
        """Ids of the tasks that any measurement of this fabric needs."""
        return (*self.test, *(task.id for task in self._shown.values()))

    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks that render the truth."""
        return tuple(self._shown.values())

    @property
    def _shown(self) -> dict[str, Task]:
        return {**self.pictures, "frames": self.frames, **({"edge": self.edge} if self.edge else {})}


def bench_tasks(recipe: Recipe, parts: Sequence[Shard], trained: Mapping[str, Mapping[str, Task]]) -> Iterator[Task]:
    """Yield the tasks of the benchmark.

    Parameters
    ----------
    recipe : Recipe
        What to measure.
    parts : sequence of Shard
        The data set.
    trained : mapping
        For each model's name its trainings by fabric; the key of a general model's only training is empty.
    """
    subjects = [_subject(recipe, fabric, "seen", parts) for fabric in recipe.seen]
    subjects += [_subject(recipe, fabric, "unseen", parts) for fabric in recipe.unseen]
    for subject in subjects:
        yield from subject.tasks
    for subject in subjects:
        yield _truth_task(recipe, subject, parts)
        for model in recipe.models:
            trainings = trained.get(model.options.name, {})
            training = trainings.get("" if "" in trainings else subject.fabric.name)
            if training or not model.learns:  # else another recipe trains it, on other cloths
                yield _method_task(recipe, model, subject, parts, [training] if training else [])
    for model in recipe.models:
        if model.options.blends:
            yield _latents_task(recipe, model, trained[model.options.name][""])
    for name in recipe.bench.scenes.names:
        yield from scene_tasks(recipe, name, trained)
    for model in recipe.models:
        yield from _extremes_tasks(recipe, model, trained.get(model.options.name, {}))
    yield _timing_task(recipe, subjects, parts, trained)


def _subject(recipe: Recipe, fabric: Fabric, role: str, parts: Sequence[Shard]) -> Subject:
    """Return a fabric with the tasks of its truth."""
    bench, look = recipe.bench, _look(fabric)
    common: dict[str, Any] = {"versions": [versions.TRUTH, versions.BENCH], "fabric": look, "seed": bench.seed}
    view = bench.view.model_dump(mode="json")

    def task(kind: str, spec: Mapping[str, Any], pixels: int, truth: TruthOptions) -> Task:
        name = f"truth-{fabric.name}-{kind}"
        return Task(
            "bench",
            "truth of the pictures",
            f"truth of {fabric.name}, {kind}",
            spec,
            (f"records/{name}-{identity('bench', spec)[:8]}.exr",),
            cost=pixels * SECONDS_A_POINT * points_a_row(truth),
            size=pixels * 28,
            setting={"make": kind, "fabric": fabric.model_dump(mode="json"), "options": bench.model_dump(mode="json")},
        )

    pictures: dict[str, Task] = {}
    for scene in bench.views:
        width, height = size = bench.size(scene)
        asked: dict[str, Any] = {
            "scene": scene,
            "size": size,
            "view": view,
            "truth": bench.truth.model_dump(mode="json"),
        }
        pictures[scene] = task(scene, common | asked, width * height, bench.truth)
    width, height = bench.frame_size
    asked = {
        "frames": bench.frames,
        "size": bench.frame_size,
        "view": view,
        "truth": bench.frame_truth.model_dump(mode="json"),
    }
    frames = task("frames", common | asked, width * height * bench.frames, bench.frame_truth)
    test = tuple(
        part.task.id for part in parts if part.question.fabric.name == fabric.name and part.question.split == "test"
    )
    edge = None
    if recipe.dataset.queries.curvature[1] > 0:
        width, height = round(bench.edge.depth / bench.edge.pixel), bench.edge.rows
        asked = {"edge": bench.edge.model_dump(mode="json")}
        edge = task("edge", common | asked, max(width, 1) * height, bench.edge.truth)
    return Subject(fabric, role, test, pictures, frames, edge)


def _truth_task(recipe: Recipe, subject: Subject, parts: Sequence[Shard]) -> Task:
    """Return the measurements of the truth itself: its noise, and what moves in its frames."""
    name = subject.fabric.name
    bench = recipe.bench.model_copy(update={"runtimes": ()})  # the truth has no other way to run
    spec = {"measure": "truth", **_asked(subject, parts, bench)}
    return Task(
        "bench",
        "truth",
        f"truth on {name}",
        spec,
        _records(f"truth-{name}-{identity('bench', spec)[:8]}"),
        subject.needs,
        cost=0.3,
        size=4000,
        setting={"make": "truth", **_setting(subject, parts, bench)},
    )


def _method_task(
    recipe: Recipe, model: ModelRecipe, subject: Subject, parts: Sequence[Shard], trainings: Sequence[Task]
) -> Task:
    """Return the measurements of a method on a fabric: errors, pictures, aliasing."""
    options, bench, name = model.options, model.measured(recipe.bench), subject.fabric.name
    spec = {
        "measure": options.version,
        "options": options.model_dump(mode="json"),
        "models": [training.id for training in trainings],
        **_asked(subject, parts, bench),
    }
    stem = f"{options.name}-{name}-{identity('bench', spec)[:8]}"
    # All knobs are measured; pictures are made of those that the recipe wants to see.
    shown = [f"k = {knob}" for knob in options.knobs if knob in bench.picture_counts] if options.knobs else [""]
    pictures = {
        setting: {
            scene: "records/" + "-".join(filter(None, (stem, setting.replace(" = ", ""), scene))) + ".exr"
            for scene in bench.views
        }
        for setting in shown
    }
    pixels = sum(width * height for width, height in map(bench.size, bench.views))
    queries = bench.frames * bench.frame_size[0] * bench.frame_size[1] + recipe.dataset.rows.test + pixels
    return Task(
        "bench",
        options.name,
        f"{options.name} on {name}",
        spec,
        (*_records(stem), *(path for scenes in pictures.values() for path in scenes.values())),
        (*subject.needs, *(training.id for training in trainings)),
        cost=1.0 + queries * options.seconds[1] * (sum(options.knobs) or 1),
        size=len(shown) * pixels * 10,
        setting={
            "make": "method",
            "model": options.model_dump(mode="json"),
            "models": [str(Path(training.products[0]).parent) for training in trainings],
            "pictures": pictures,
            **_setting(subject, parts, bench),
        },
    )


def _latents_task(recipe: Recipe, model: ModelRecipe, training: Task) -> Task:
    """Return the measurements of what lies between latents; of presets, whatever the recipe's fabrics are."""
    options, dataset = model.options, recipe.dataset
    names = sorted({name for first, second, _ in LATENT_PAIRS for name in (first, second)})
    spec = {
        "measure": "latents",
        "presets": {name: load_fabric(name).optics() for name in names},
        "versions": [versions.TRUTH, versions.BENCH, options.version],
        "options": options.model_dump(mode="json"),
        "models": [training.id],
        "queries": dataset.queries.model_dump(mode="json"),
        "truth": dataset.truth.model_dump(mode="json"),
    }
    return Task(
        "bench",
        options.name,
        f"latents of {options.name}",
        spec,
        _records(f"latents-{options.name}-{identity('bench', spec)[:8]}"),
        (training.id,),
        cost=10.0,
        size=4000,
        alone=True,  # edits are timed
        setting={
            "make": "latents",
            "model": options.model_dump(mode="json"),
            "models": [str(Path(training.products[0]).parent)],
        },
    )


def _extremes_tasks(recipe: Recipe, model: ModelRecipe, trainings: Mapping[str, Task]) -> Iterator[Task]:
    """Yield the measurements of a model's methods at their extremes, on one fabric of each role, if it knows any."""
    options = model.options
    known = [
        [fabric for fabric in named if not model.learns or {"", fabric.name} & trainings.keys()]
        for named in (recipe.seen, recipe.unseen)
    ]
    fabrics = [(fabric, role) for role, named in zip(("seen", "unseen"), known, strict=True) for fabric in named[:1]]
    if not fabrics:
        return
    # Of networks that know one fabric each, those of the fabrics asked about.
    needed = [trainings[key] for key in ("", *(fabric.name for fabric, _ in fabrics)) if key in trainings]
    spec = {
        "measure": "extremes",
        "versions": [versions.TRUTH, versions.EXTREMES, options.version],
        "options": options.model_dump(mode="json"),
        "models": [training.id for training in needed],
        "fabrics": [[fabric.name, fabric.optics(), role] for fabric, role in fabrics],
        "physics": recipe.dataset.truth.model_dump(mode="json", include=set(PHYSICS)),
    }
    yield Task(
        "bench",
        options.name,
        f"extremes of {options.name}",
        spec,
        _records(f"extremes-{options.name}-{identity('bench', spec)[:8]}"),
        tuple(training.id for training in needed),
        cost=3.0,
        size=6000,
        setting={
            "make": "extremes",
            "model": options.model_dump(mode="json"),
            "models": [str(Path(training.products[0]).parent) for training in needed],
            "of_one_material": options.of_one_material,
            "fabrics": [[fabric.model_dump(mode="json"), role] for fabric, role in fabrics],
        },
    )


def _timing_task(
    recipe: Recipe, subjects: Sequence[Subject], parts: Sequence[Shard], trained: Mapping[str, Mapping[str, Task]]
) -> Task:
    """Return the timing of all methods side by side; nothing else may run meanwhile."""
    bench = recipe.bench
    trainings = [task for tasks in trained.values() for task in tasks.values()]
    test = tuple(key for subject in subjects for key in subject.test)
    spec = {
        "measure": "timing",
        "version": versions.BENCH,
        "dataset": fingerprint_of(parts),
        "options": bench.model_dump(mode="json", include={"rows", "bounds", "runtimes", "seed", *_TIMED}),
        "models": [[model.options.version, model.options.model_dump(mode="json")] for model in recipe.models],
        "trainings": [task.id for task in trainings],
    }
    # Said apart from the options where a model has ways of its own.
    if own := {m.options.name: m.runtimes for m in recipe.models if m.runtimes is not None}:
        spec["runtimes"] = own
    return Task(
        "bench",
        "timing",
        "timing of all methods",
        spec,
        _records(f"timing-{identity('bench', spec)[:8]}"),
        (*test, *(task.id for task in trainings)),
        cost=60.0,
        size=60_000,
        setting={
            "make": "timing",
            "dataset": folder_of(parts),
            "options": bench.model_dump(mode="json"),
            "models": [
                {
                    "options": model.options.model_dump(mode="json"),
                    "folders": [
                        str(Path(task.products[0]).parent) for task in trained.get(model.options.name, {}).values()
                    ],
                    "runtimes": model.measured(bench).runtimes,
                }
                for model in recipe.models
            ],
        },
        alone=True,
    )


def _look(fabric: Fabric) -> dict[str, Any]:
    """Return all of a fabric that shapes its pictures: its optics and colours, and its name, which seeds them."""
    shown = {"specular", "diffuse", "diffuse_transmission"}
    colours = fabric.model_dump(mode="json", include={"warp": shown, "weft": shown})
    return {"name": fabric.name, "optics": fabric.optics(), "colours": colours}


def _asked(subject: Subject, parts: Sequence[Shard], bench: BenchOptions) -> dict[str, Any]:
    """Return what a measurement of a fabric depends on that measures what `bench` asks."""
    return {
        "version": versions.BENCH,
        "dataset": fingerprint_of(parts),
        "bench": bench.model_dump(mode="json", exclude={*_TIMED, "edge", "scenes"}),
        "fabric": _look(subject.fabric),
        "role": subject.role,
        "truth": fingerprint(subject.needs),
    }


def _setting(subject: Subject, parts: Sequence[Shard], bench: BenchOptions) -> dict[str, Any]:
    """Return what every measurement of a fabric needs to run."""
    return {
        "dataset": folder_of(parts),
        "fabric": subject.fabric.name,
        "role": subject.role,
        "truth": subject.truth,
        "options": bench.model_dump(mode="json"),
    }


def _records(stem: str) -> tuple[str, str]:
    """Return the files of a task's records and of the machine they were measured on."""
    return f"records/{stem}.json", f"records/{stem}.machine.json"
