"""Subjects of a recipe's measurements: its fabrics with their test rows, its models with their trained networks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from jobs.plan.dataset import DataSet
from jobs.plan.task import PLACE, Made, Place, TaskPart
from jobs.plan.training import Training
from jobs.recipe.recipe import ModelRecipe, Recipe
from pipeline.models.catalogue import ModelOptions
from pipeline.models.options import RoundFootprint
from reports.options import BenchOptions, Role, RunOptions, select
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from pipeline.models.fallback import Fallback
    from pipeline.models.method import Method
    from pipeline.shards.manifest import Manifest
    from reports.measure.held_out import HeldOutFabric


_EXPORT = 2.5  # seconds in which a network is exported to another runtime and compiled there


class HeldOutRows(TaskPart):
    """Held-out rows of a data set that a measurement reads."""

    fingerprint: str  # fingerprint of the whole data set
    rows: tuple[str, ...]  # ids of the tasks that make the rows
    folder: Place

    @property
    def needs(self) -> tuple[str, ...]:
        """The tasks that make the rows."""
        return self.rows

    def manifest(self, out: Path) -> Manifest:
        """Load the manifest of the data set."""
        from pipeline.shards.manifest import Manifest

        return Manifest.load(out / self.folder)

    def read(self, out: Path, names: Sequence[str] | None = None, rows: int | None = None) -> Iterator[HeldOutFabric]:
        """Yield the first rows of each fabric; left out: all rows, of all named fabrics."""
        from reports.measure.held_out import held_out

        manifest = self.manifest(out)
        for name in names or manifest.names("seen", "unseen"):
            yield held_out(manifest, out / self.folder, name, rows)


class Trained(TaskPart):
    """A model, and the networks that were trained of it."""

    options: ModelOptions
    networks: tuple[Made, ...] = ()  # its trained networks; none where nothing is trained
    seed: Annotated[int, PLACE] = 0  # seed of their training, which the ids of the networks depend on

    @property
    def title(self) -> str:
        """Name of the model, with the seed of its training where that is not 0."""
        return f"{self.options.name}, seed {self.seed}" if self.seed else self.options.name

    def shown(self, counts: Sequence[int]) -> tuple[str, ...]:
        """Return the settings that pictures are made of: numbers of points in `counts`, the usual or the only one."""
        settings, usual = self.options.settings, self.options.usual_setting
        shown = (self.options.setting_of(k) for k in settings if k in counts or k == usual)
        return tuple(shown) if settings else (self.options.variant,)

    def seconds(self, queries: float, fabrics: float = 1.0, ways: RunOptions | None = None) -> float:
        """Return the estimated seconds in which one core answers queries with every setting, of so many fabrics.

        With `ways`, trained networks answer in these too; they are exported for each runtime and fabric.
        """
        options = self.options
        runtimes, bounds = (len(ways.runtimes), ways.bounds) if ways and self.networks else (0, False)
        prepared = options.prepare_seconds + _EXPORT * runtimes
        return fabrics * prepared + (1 + bounds + runtimes) * queries * options.seconds[1] * options.work

    def methods(self, out: Path) -> list[Method]:
        """Load its methods, one a setting."""
        from pipeline.models.registry import load_methods

        return load_methods(self.options, [out / network.path for network in self.networks])

    def with_fallback(self, out: Path, footprint: RoundFootprint) -> list[Fallback]:
        """Load its methods so that they answer any query."""
        from pipeline.models.fallback import Fallback

        return [Fallback(method, self.options.kinds, footprint) for method in self.methods(out)]

    def variants(self, methods: Sequence[Method], ways: RunOptions) -> list[Method]:
        """Return trained methods with or without an energy bound, and in other runtimes."""
        if not self.networks:
            return []
        from pipeline.models.bounded import Bounded
        from pipeline.models.runtimes import runs

        others: list[Method] = [Bounded(method) for method in methods if ways.bounds]
        return others + [run for method in methods for run in runs(method, ways.runtimes)]


@dataclass(frozen=True)
class ModelSubject:
    """A model of the recipe, trained with one seed."""

    recipe: ModelRecipe  # the model with this training alone
    trainings: Mapping[str, Training]  # trainings by fabric; a general model has one, with an empty key
    is_first: bool = True  # true for the first seed, which pictures are made of and times are taken of

    def on(self, fabrics: Sequence[str]) -> Trained | None:
        """Return the model with the networks that answer for fabrics; None where it was not trained on one of them."""
        options = self.recipe.options
        if not self.recipe.learns:
            return Trained(options=options)
        if "" in self.trainings:
            return self._with([""])
        return self._with(fabrics) if self.trainings.keys() >= set(fabrics) else None

    @property
    def whole(self) -> Trained:
        """The model with the networks of all fabrics."""
        return self._with(list(self.trainings))

    def _with(self, keys: Sequence[str]) -> Trained:
        networks = tuple(self.trainings[key].made for key in keys)
        return Trained(options=self.recipe.options, networks=networks, seed=self.recipe.training.seed)

    def ways(self, bench: BenchOptions) -> RunOptions:
        """Return the ways to use the networks that are measured too; other runtimes only of the first seed."""
        ways = select(RunOptions, self.recipe.measured(bench))
        unused = {} if self.is_first else {"runtimes": ()}
        return ways.model_copy(update=unused)


@dataclass(frozen=True)
class Subjects:
    """Fabrics, models, rows and networks that the measurements of a recipe use."""

    recipe: Recipe
    dataset: DataSet
    trainings: Mapping[str, Sequence[Mapping[str, Training]]]
    """Trainings by the model's name, then one mapping from fabrics a seed."""

    @property
    def fabrics(self) -> list[tuple[Fabric, Role]]:
        """The named fabrics with their roles: the seen ones, then the unseen ones."""
        return list(self.recipe.tested[: len(self.recipe.seen) + len(self.recipe.unseen)])

    @cached_property
    def models(self) -> list[ModelSubject]:
        """The models in the order of the recipe, once for each seed that they are trained with."""
        models = []
        for model in self.recipe.models:
            trained = zip(model.single, self.trainings.get(model.options.name, [{}]), strict=True)
            models += [ModelSubject(single, nets, is_first=not index) for index, (single, nets) in enumerate(trained)]
        return models

    @property
    def first_models(self) -> list[ModelSubject]:
        """The models, each trained with its first seed."""
        return [model for model in self.models if model.is_first]

    def answering(self, fabrics: Sequence[str]) -> list[tuple[ModelSubject, Trained]]:
        """Return the models of all seeds that answer for all of some fabrics, with the networks that do."""
        return [(model, trained) for model in self.models if (trained := model.on(fabrics))]

    def held_out(self, *fabrics: Fabric) -> HeldOutRows:
        """Return the test rows of fabrics."""
        rows = tuple(id for fabric in fabrics for id in self._test_rows[fabric.name])
        return HeldOutRows(fingerprint=self.dataset.fingerprint, rows=rows, folder=self.dataset.folder)

    @cached_property
    def _test_rows(self) -> Mapping[str, Sequence[str]]:
        rows: dict[str, list[str]] = {fabric.name: [] for fabric in self.recipe.fabrics}
        for part in self.dataset.shards:
            if part.shard.split == "test":
                rows[part.shard.fabric.name].append(part.id)
        return rows
