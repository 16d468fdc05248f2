"""How the tasks of benchmark and report are done: what they read, which measurement or page, where it goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from jobs.plan.task import Task
from pipeline.models.bounded import counterpart
from pipeline.models.catalogue import ModelOptions
from pipeline.models.domain import PHYSICS
from pipeline.models.fallback import Fallback
from pipeline.models.method import Method
from pipeline.models.registry import load_methods
from pipeline.models.runtimes import not_run, runs
from pipeline.shards.manifest import Manifest
from pipeline.shards.queries import QueryOptions
from pipeline.truth.options import TruthOptions
from reports.measure.by_size import measure_by_size
from reports.measure.extremes import TRUTH as EXTREMES_TRUTH
from reports.measure.extremes import lustrous, measure_extremes
from reports.measure.frames import measure_aliasing, measure_truth_frames, render_frames
from reports.measure.furnace import measure_furnace
from reports.measure.held_out import measure_errors, measure_timing, measure_truth
from reports.measure.latents import measure_edits, measure_paths, pairs
from reports.measure.pictures import render_method, render_truth
from reports.measure.scene.scene_errors import measure_scene, time_scene, write_truth
from reports.measure.scene.shot import read_shot, shoot
from reports.measure.silhouette import measure_silhouette, render_edge
from reports.measure.timing import thread_counts
from reports.options import EXTREME_PRECISIONS, BenchOptions
from reports.page.content import ModelNote, PageInput
from reports.page.page import write_page
from reports.page.picture_strips import PictureFile
from reports.record import Provenance, Record, read_machine, read_records, this_machine, write_records
from weaves.fabric import Fabric

Progress = Callable[[float], None]


def picture(task: Task, out: Path, progress: Progress) -> None:
    """Render the truth's picture of a scene."""
    fabric = Fabric.model_validate(task.setting["fabric"])
    render_truth(fabric, task.setting["make"], _options(task), out / task.products[0])


def frames(task: Task, out: Path, progress: Progress) -> None:
    """Render the truth's frames."""
    render_frames(Fabric.model_validate(task.setting["fabric"]), _options(task), out / task.products[0])


def edge(task: Task, out: Path, progress: Progress) -> None:
    """Render the truth's edge of a cloth cylinder."""
    render_edge(Fabric.model_validate(task.setting["fabric"]), _options(task).edge, out / task.products[0])


def truth(task: Task, out: Path, progress: Progress) -> None:
    """Measure the truth on one fabric."""
    setting, options, folder = task.setting, _options(task), out / task.setting["dataset"]
    manifest, name, role = Manifest.load(folder), setting["fabric"], setting["role"]
    provenance = Provenance(dataset=manifest.fingerprint)
    records = measure_truth(manifest, folder, name, role, options, provenance)
    records += measure_truth_frames(manifest.fabrics[name], role, options, out / setting["truth"]["frames"], provenance)
    write_records(out / task.products[0], records, this_machine(1))


def method(task: Task, out: Path, progress: Progress) -> None:
    """Measure a method on one fabric: errors, pictures, aliasing, and the silhouette of curved cloth."""
    setting, options, folder = task.setting, _options(task), out / task.setting["dataset"]
    manifest, name, role = Manifest.load(folder), setting["fabric"], setting["role"]
    fabric = manifest.fabrics[name]
    provenance = Provenance(dataset=manifest.fingerprint, model=" ".join(task.spec["models"]))
    records: list[Record] = []
    methods = _methods(setting["model"], setting["models"], out, options)
    for index, one in enumerate(methods):
        records += measure_errors(one, manifest, folder, name, role, options, provenance)
        records += measure_furnace(one, fabric, role, provenance)
        records += measure_aliasing(one, fabric, role, options, out / setting["truth"]["frames"], provenance)
        if "edge" in setting["truth"]:
            reference = out / setting["truth"]["edge"]
            records += measure_silhouette(one, fabric, role, options.edge, reference, provenance)
        for scene, path in setting["pictures"].get(one.setting, {}).items():
            reference = out / setting["truth"][scene]
            records += render_method(one, fabric, role, scene, options, reference, out / path, provenance)
        progress((index + 1) / len(methods))
    write_records(out / task.products[0], records, this_machine(1))


def extremes(task: Task, out: Path, progress: Progress) -> None:
    """Measure every method that a model's options describe at its extremes, in half precision too if it is trained."""
    setting, spec = task.setting, task.spec
    fabrics = [(Fabric.model_validate(fabric), role) for fabric, role in setting["fabrics"]]
    if not setting["of_one_material"]:
        fabrics.append((lustrous(fabrics[0][0]), "unseen"))
    provenance = Provenance(model=" ".join(spec["models"]))
    precisions = EXTREME_PRECISIONS if setting["models"] else ()
    families = [[one, *runs(one, precisions)] for one in _methods(setting["model"], setting["models"], out)]
    physics = TruthOptions.model_validate(spec["physics"])
    truth = EXTREMES_TRUTH.model_copy(update={name: getattr(physics, name) for name in PHYSICS})
    records = measure_extremes(families, fabrics, provenance, truth)
    write_records(out / task.products[0], records, this_machine(1))


def latents(task: Task, out: Path, progress: Progress) -> None:
    """Measure what lies between latents, and what an edit costs."""
    setting, spec = task.setting, task.spec
    (one,) = _methods(setting["model"], setting["models"], out)
    provenance = Provenance(model=" ".join(spec["models"]))
    chosen, asked = pairs(), QueryOptions.model_validate(spec["queries"])
    records = measure_edits(one, chosen[0].first, provenance=provenance)
    for index, pair in enumerate(chosen):
        truth = TruthOptions.model_validate(spec["truth"])
        records += measure_paths(one, [pair], asked, truth, provenance=provenance)
        progress((index + 1) / len(chosen))
    write_records(out / task.products[0], records, this_machine(1))


def timing(task: Task, out: Path, progress: Progress) -> None:
    """Time all methods side by side, on all queries and by the size of their footprints."""
    options, folder = _options(task), out / task.setting["dataset"]
    manifest = Manifest.load(folder)
    asked = [(model["options"], model["folders"], out) for model in task.setting["models"]]
    provenance = Provenance(dataset=manifest.fingerprint)
    benches = [options.model_copy(update={"runtimes": model["runtimes"]}) for model in task.setting["models"]]
    loaded = [(_methods(*ask), ask[1], bench) for ask, bench in zip(asked, benches, strict=True)]
    methods = [one for found, *_ in loaded for one in found]
    variants = [one for found, folders, bench in loaded for one in _variants(found, folders, bench)]
    records = measure_timing(methods + variants, manifest, folder, options, provenance)
    progress(0.6)
    records += [record for found, _, bench in loaded for one in found for record in _not_run(one, bench, provenance)]
    records += measure_by_size(methods, manifest, folder, options, provenance)
    write_records(out / task.products[0], records, this_machine(max(thread_counts(options.threads))))


def shot(task: Task, out: Path, progress: Progress) -> None:
    """Work out a scene's frames with the truth's answers."""
    options = _options(task).scenes
    frames = out / task.products[0]
    shoot(task.setting["scene"], options, frames)
    write_truth(read_shot(frames), out / task.products[1])


def scene(task: Task, out: Path, progress: Progress) -> None:
    """Measure a method on a scene."""
    setting, options = task.setting, _options(task)
    pictures = {name: out / path for name, path in setting["pictures_of"].items()}
    provenance = Provenance(model=" ".join(task.spec["models"]))
    methods = _fallbacks(setting, options, out)
    records = measure_scene(methods, read_shot(out / setting["frames"]), options, pictures, provenance)
    write_records(out / task.products[0], records, this_machine(1))


def frame_time(task: Task, out: Path, progress: Progress) -> None:
    """Time a frame of a scene by all methods."""
    options, frames = _options(task), read_shot(out / task.setting["frames"])
    methods = [one for entry in task.setting["methods"] for one in _fallbacks(entry, options, out)]
    write_records(out / task.products[0], time_scene(methods, frames, options), this_machine(1))


def page(task: Task, out: Path, progress: Progress) -> None:
    """Write the page of a recipe."""
    setting = task.setting
    # What was measured without a recipe is shown if it was there when the page was planned; no page waits for it.
    records = read_records(out / path for path in (*setting["records"], *task.spec["alone"]))
    # What is measured is the same whoever asks; whose page this is enters here.
    asked = {"recipe": task.spec["recipe"], "recipe_fingerprint": task.id}
    records = [
        record.model_copy(update={"provenance": record.provenance.model_copy(update=asked)}) for record in records
    ]
    content = PageInput(
        recipe=task.spec["recipe"],
        about=task.spec["about"],
        fingerprint=task.id,
        dataset=setting["dataset"],
        fabrics=[(Fabric.model_validate(fabric), role) for fabric, role in setting["fabrics"]],
        models=[ModelNote(**note) for note in setting["models"]],
        options=_options(task),
        records=records,
        machine=read_machine(out / setting["timing"]),
        pictures=[PictureFile(**(file | {"path": out / file["path"]})) for file in setting["pictures"]],
    )
    write_page((out / task.products[0]).parent, content, progress)


def _options(task: Task) -> BenchOptions:
    return BenchOptions.model_validate(task.setting["options"])


def _fallbacks(entry: Mapping[str, Any], options: BenchOptions, out: Path) -> list[Fallback]:
    """Load the methods of a model so that they answer any query."""
    kinds = TypeAdapter[Any](ModelOptions).validate_python(entry["model"]).kinds
    methods = _methods(entry["model"], entry["models"], out)
    return [Fallback(one, kinds, options.scenes.footprint) for one in methods]


def _methods(
    options: Mapping[str, Any], folders: list[str], out: Path, bench: BenchOptions | None = None
) -> list[Method]:
    """Load the methods that a model's options describe; with `bench` also what it asks of each trained one."""
    model = TypeAdapter[Any](ModelOptions).validate_python(options)
    methods = load_methods(model, [out / folder for folder in folders])
    return methods + (_variants(methods, folders, bench) if bench else [])


def _variants(methods: list[Method], folders: list[str], bench: BenchOptions) -> list[Method]:
    """Return what a benchmark measures beside trained methods: counterparts without or with a bound, and runtimes."""
    if not folders:
        return []
    others = [counterpart(one) for one in methods if bench.bounds]
    return others + [run for one in methods for run in runs(one, bench.runtimes)]


def _not_run(method: Method, bench: BenchOptions, provenance: Provenance) -> list[Record]:
    """Return a record for every way in which this machine cannot run a trained method."""
    return [
        Record(method=method.name, setting=name, metric="not_run", value=1.0, note=reason, provenance=provenance)
        for name, reason in not_run(method, bench.runtimes).items()
    ]
