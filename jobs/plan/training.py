"""Trainings: one of a model for all fabrics of a recipe, or one a fabric."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

from jobs.plan.dataset import DataSet
from jobs.plan.task import Made, Place, Progress, Stage, Task
from jobs.recipe.recipe import ModelRecipe
from pipeline import versions
from pipeline.models.added.added_code import AddedMethod
from pipeline.models.catalogue import ModelOptions
from pipeline.shards.generate import set_name
from pipeline.training.options import TrainingOptions

_WHERE_IT_RUNS = {"device", "checkpoint_every"}  # of the training's options


class Training(Task):
    """The task that trains one network; it reads its fabrics' rows: training, validation, and its extra rows."""

    stage: ClassVar[Stage] = "train"

    options: ModelOptions
    training: TrainingOptions
    fabrics: tuple[str, ...]
    shards: tuple[str, ...]  # ids of the tasks that make its rows
    dataset: Place

    @classmethod
    def planned(cls, dataset: DataSet, model: ModelRecipe) -> list[dict[str, Training]]:
        """Return the trainings of a model on a data set, in the order of their seeds.

        Of each seed one under the key "", or one a fabric for a model of a single material.
        """
        recipe = dataset.recipe
        groups = {"": [fabric.name for fabric in (*recipe.seen, *recipe.population)]}
        if model.options.of_one_material:
            groups = {fabric.name: [fabric.name] for fabric in (*recipe.seen, *recipe.unseen)}
        splits = {"train", "validation", *map(set_name, model.options.extra_rows)}
        group_of = {name: key for key, names in groups.items() for name in names}
        read: dict[str, dict[str, Any]] = {key: {"fabrics": names, "shards": []} for key, names in groups.items()}
        for part in dataset.shards:
            if part.shard.split in splits and (key := group_of.get(part.shard.fabric.name)) is not None:
                read[key]["shards"].append(part.id)
        trainings = []
        for single in model.single:
            own: dict[str, Any] = {"options": single.options, "training": single.training, "dataset": dataset.folder}
            trainings.append({key: cls(**own, **rows) for key, rows in read.items()})
        return trainings

    @property
    def group(self) -> str:
        """Name of the model."""
        return self.options.name

    @property
    def title(self) -> str:
        """Name of the model and its fabrics."""
        seed = f", seed {self.training.seed}" if self.training.seed else ""
        return f"{self.options.name} on {self._fabric or f'{len(self.fabrics)} fabrics'}{seed}"

    @property
    def products(self) -> tuple[str, ...]:
        """Weights and card."""
        return (f"{self.folder}/model.safetensors", f"{self.folder}/card.json")

    @property
    def folder(self) -> str:
        """Folder of the products."""
        return f"models/{'-'.join(filter(None, (self.options.name, self._fabric)))}-{self.id[:8]}"

    @property
    def made(self) -> Made:
        """The trained network, as measurements read it."""
        return Made(task=self.id, path=self.folder)

    @property
    def needs(self) -> tuple[str, ...]:
        """The tasks that make its rows."""
        return self.shards

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return self.training.steps * self.training.batch * self.options.seconds[0]

    @property
    def _fabric(self) -> str:
        """The only fabric of a network of one material; else empty."""
        return self.fabrics[0] if self.options.of_one_material else ""

    def versions(self) -> dict[str, int]:
        """Return the versions of the model and of the training loop; those of the truth are in the rows."""
        return {"model": self.options.version, "training": versions.TRAINING}

    def identity(self) -> dict[str, Any]:
        """Return the identity of the weights, without the device and the interval of saving."""
        content = super().identity()
        training = {name: value for name, value in content["training"].items() if name not in _WHERE_IT_RUNS}
        return content | {"training": training}

    def run(self, out: Path, progress: Progress) -> None:
        """Train; a network from outside in a process that can be ended.

        MethodFailed if the code of a network from outside fails.
        """
        if isinstance(self.options, AddedMethod):
            from pipeline.models.added.apart import run_apart

            return run_apart(_train, self, out, limits=[self.options], progress=progress)
        return _train(self, out, progress)


def _train(task: Training, out: Path, progress: Progress) -> None:
    from pipeline.training.loop import train

    train(task.options, task.training, out / task.dataset, list(task.fabrics), out / task.folder, progress)
