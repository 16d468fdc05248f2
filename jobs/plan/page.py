"""The page of a recipe: the task that writes it from all measurements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar

from jobs.plan.measurements.fabrics import TimeOfMethods
from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.scenes import SceneShot
from jobs.plan.measurements.subjects import Subjects
from jobs.plan.measurements.truth import LivePage
from jobs.plan.task import PLACE, Place, Places, Progress, Stage, Task
from jobs.plan.training import Training
from jobs.recipe.recipe import ModelRecipe, Recipe
from pipeline.models.added.added_code import ADDED_MODEL, AddedMethod
from reports import catalogue
from reports.catalogue import AddedMetric, enter
from reports.options import BenchOptions, Role
from reports.page.content import ModelNote, PictureFile
from weaves.fabric import Fabric


class Page(Task):
    """The task that writes the page of a recipe."""

    stage: ClassVar[Stage] = "report"
    group: ClassVar = "page"
    cost: ClassVar = 15.0

    recipe: str
    about: str
    dataset: str  # name and fingerprint of the data set
    fabrics: tuple[tuple[Fabric, Role], ...]
    models: tuple[ModelNote, ...]
    options: BenchOptions
    metrics: Annotated[tuple[AddedMetric, ...], PLACE]
    """Metrics from outside; the ids of their measurements are in `measured`."""
    measured: tuple[str, ...]  # ids of the measurements
    records: Places  # files of Records of the measurements
    timing: Place  # file of the Records of times; the machine beside it is the page's
    pictures: Annotated[tuple[PictureFile, ...], PLACE]
    live: Annotated[dict[str, str], PLACE]  # live page of each fabric that has one, by the fabric's name

    @classmethod
    def planned(cls, subjects: Subjects, benches: Sequence[Measurement]) -> Page:
        """Return the page of all measurements."""
        recipe = subjects.recipe
        shots = [task for task in benches if isinstance(task, SceneShot) and not task.larger]
        firsts = {name: trainings[0] for name, trainings in subjects.trainings.items()}
        models = [_note(recipe, model, firsts.get(model.options.name, {}), shots) for model in recipe.models]
        forms = [entry.form for entry in recipe.entries]
        models += [ModelNote(form.name, form.about, per_material=form.each_fabric, kind=ADDED_MODEL) for form in forms]
        return cls(
            recipe=recipe.name,
            about=recipe.about,
            dataset=f"{recipe.name}, {subjects.dataset.fingerprint}",
            fabrics=recipe.tested,
            models=tuple(models),
            options=recipe.bench,
            metrics=recipe.metrics,
            measured=tuple(task.id for task in benches),
            records=tuple(task.records for task in benches if task.records),
            timing=next(task.records for task in benches if isinstance(task, TimeOfMethods)),
            pictures=tuple(picture for task in benches for picture in task.pictures),
            live={task.fabric.name: task.products[0] for task in benches if isinstance(task, LivePage)},
        )

    @property
    def title(self) -> str:
        """Recipe."""
        return f"page of {self.recipe}"

    @property
    def products(self) -> tuple[str, ...]:
        """The page, and the list of the other files in its folder with their hashes."""
        return (f"{self.folder}/index.html", f"{self.folder}/files.json")

    @property
    def folder(self) -> str:
        """Folder of the page."""
        return f"report/{self.recipe}"

    @property
    def needs(self) -> tuple[str, ...]:
        """All measurements."""
        return self.measured

    def written(self, out: Path) -> tuple[str, ...]:
        """Return the files of its folder."""
        from reports.page.files import read_files

        return (*(f"{self.folder}/{name}" for name in read_files(out / self.folder)), *reversed(self.products))

    def versions(self) -> dict[str, int]:
        """Return the version of the benchmark."""
        return {"bench": catalogue.BENCH}

    def run(self, out: Path, progress: Progress) -> None:
        """Write it."""
        from reports.page.content import PageInput
        from reports.page.page import write_page
        from reports.record import read_machine, read_records

        # Measurements are the same in every recipe; the page adds the recipe's name.
        for metric in self.metrics:
            enter(metric.row)
        own = {"recipe": self.recipe, "recipe_fingerprint": self.id}
        content = PageInput(
            recipe=self.recipe,
            about=self.about,
            fingerprint=self.id,
            dataset=self.dataset,
            fabrics=self.fabrics,
            models=self.models,
            options=self.options,
            records=[
                record.model_copy(update={"provenance": record.provenance.model_copy(update=own)})
                for record in read_records(out / path for path in self.records)
            ],
            machine=read_machine(out / self.timing),
            pictures=[replace(picture, path=out / picture.path) for picture in self.pictures],
            live={fabric: out / path for fabric, path in self.live.items()},
        )
        write_page(out / self.folder, content, progress)


def _note(
    recipe: Recipe, model: ModelRecipe, trainings: Mapping[str, Training], shots: Sequence[SceneShot]
) -> ModelNote:
    """Return the page's note on a model; `trainings` are those of its first seed."""
    options, training = model.options, model.training
    kind = "" if options.name == options.model else f"{options.model}: "
    unlike = f"; unlike the paper: {', '.join(options.departures)}" if options.departures else ""
    about = f"{kind}nothing is trained{unlike}"
    if isinstance(options, AddedMethod):
        about = f"from outside this package: {options.origin}"
        kind = f"{about}; "
    if trainings:
        first = next(iter(trainings.values()))
        what = "each fabric by itself" if model.options.of_one_material else f"{len(first.fabrics)} fabrics at once"
        about = f"{kind}{what}, {training.steps:,} steps of {training.batch:,} queries{unlike}"
        if model.seeds > 1:
            about += f", {model.seeds} trainings with the seeds {training.seed} to {training.seed + model.seeds - 1}"
        if (trainer := recipe.trainer_of(model)) is not recipe:
            own = "" if trainer.dataset.queries == recipe.dataset.queries else ", on queries of its own"
            about += f"; trained by the recipe {trainer.name}{own}"
        about += _left_out(recipe, model, trainings, shots)
    return ModelNote(
        name=options.name,
        about=about,
        fingerprint=" ".join(task.id for task in trainings.values()),
        per_material=model.options.of_one_material,
        kind=options.model,
    )


def _left_out(recipe: Recipe, model: ModelRecipe, trainings: Mapping[str, Training], shots: Sequence[SceneShot]) -> str:
    if not model.options.of_one_material:
        return ""
    fabrics = [fabric.name for fabric in (*recipe.seen, *recipe.unseen) if fabric.name not in trainings]
    scenes = [f"in the scene {shot.scene}" for shot in shots if not trainings.keys() >= set(shot.fabrics)]
    random = ["on random unseen fabrics"] if recipe.unseen_population else []
    where = [f"on {name}" for name in fabrics] + random + scenes
    return f"; left out {', '.join(where)}: it was not trained on that cloth" if where else ""
