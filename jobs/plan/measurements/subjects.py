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
from jobs.recipe.recipe import Recipe
from pipeline.models.catalogue import ModelOptions
from pipeline.models.options import RoundFootprint
from reports.options import BenchOptions, Role, RunOptions, RuntimeName, select
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
        for name in manifest.names("seen", "unseen") if names is None else names:
            yield held_out(manifest, out / self.folder, name, rows)


class Trained(TaskPart):
    """A model of the recipe, and the networks that were trained of it with one seed."""

    options: ModelOptions
    networks: tuple[Made, ...] = ()  # its trained networks; none where nothing is trained
    # What the ids of the networks depend on, and what others make of it, is no part of an identity.
    fabrics: Annotated[tuple[str, ...], PLACE] = ()  # fabric of each network; a general model has one, called ""
    seed: Annotated[int, PLACE] = 0  # seed of their training
    is_first: Annotated[bool, PLACE] = True  # true for the first seed, which pictures are made of and times are of
    runtimes: Annotated[tuple[RuntimeName, ...], PLACE] = ()  # other ways to run them that are measured

    @property
    def title(self) -> str:
        """Name of the model, with the seed of its training where that is not 0."""
        return f"{self.options.name}, seed {self.seed}" if self.seed else self.options.name

    def on(self, fabrics: Sequence[str]) -> Trained | None:
        """Return the model with the networks that answer for fabrics; None where it was not trained on one of them."""
        own = dict(zip(self.fabrics, self.networks, strict=True))
        if not own or "" in own:
            return self
        if not own.keys() >= set(fabrics):
            return None
        return self.model_copy(update={"networks": tuple(own[name] for name in fabrics), "fabrics": tuple(fabrics)})

    def run_options(self, bench: BenchOptions) -> RunOptions:
        """Return the ways to use the networks that are measured too."""
        return select(RunOptions, bench).model_copy(update={"runtimes": self.runtimes})

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
    def models(self) -> list[Trained]:
        """The models in the order of the recipe with all their networks, once for each seed.

        Other runtimes are measured of the first seed alone.
        """
        models = []
        for model in self.recipe.models:
            own = model.runtimes if model.runtimes is not None else self.recipe.bench.runtimes
            for index, trainings in enumerate(self.trainings.get(model.options.name, [{}])):
                models.append(
                    Trained(
                        options=model.options,
                        networks=tuple(training.made for training in trainings.values()),
                        fabrics=tuple(trainings),
                        seed=model.training.seed + index,
                        is_first=not index,
                        runtimes=own if model.options.learns and not index else (),
                    )
                )
        return models

    def answering(self, fabrics: Sequence[str]) -> list[Trained]:
        """Return the models of all seeds that answer for all of some fabrics, with the networks that do."""
        return [trained for model in self.models if (trained := model.on(fabrics))]

    def held_out(self, *fabrics: Fabric) -> HeldOutRows:
        """Return the test rows of fabrics."""
        rows = tuple(id for fabric in fabrics for id in self._test_rows[fabric.name])
        return HeldOutRows(fingerprint=self.dataset.fingerprint, rows=rows, folder=self.dataset.folder)

    @cached_property
    def _test_rows(self) -> Mapping[str, Sequence[str]]:
        rows: dict[str, list[str]] = {}
        for part in self.dataset.shards:
            if part.shard.split == "test":
                rows.setdefault(part.shard.fabric.name, []).append(part.id)
        return rows
