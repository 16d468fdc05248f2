"""Recipes: which fabrics, how many rows, which models, which measurements.

Four kinds of fabrics: `seen` ones are named, trained on and measured; members of the `population` are drawn at random
and only trained on; `unseen` ones are named and only measured; members of the `unseen_population` are drawn at random
and only measured, on held-out queries. A named unseen fabric has training rows too when a model of a single material
(`neumip`) is in the recipe, and no other model ever reads them. Such a model is not measured on random unseen fabrics.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import AfterValidator, Field, StrictInt, StrictStr, model_validator

from pipeline import versions
from pipeline.fingerprint import fingerprint
from pipeline.models.catalogue import ModelOptions
from pipeline.models.domain import PHYSICS
from pipeline.shards.queries import QueryOptions
from pipeline.training.options import TrainingOptions
from pipeline.truth.options import TruthOptions
from reports.catalogue import AddedMetric
from reports.options import BenchOptions, RuntimeName
from reports.options import Role as MeasuredAs
from weaves.fabric import Fabric
from weaves.population import Population
from weaves.validation import FileName, Frozen

if TYPE_CHECKING:
    from jobs.recipe.entry import Entry
    from pipeline.shards.generate import ExtraRows
    from pipeline.shards.manifest import Role, Split


MOST_UNSEEN: Final = 1000  # most fabrics of an unseen population: each is measured by every general model


def _not_too_many(population: Population) -> Population:
    if population.count > MOST_UNSEEN:
        raise ValueError(f"count is {population.count:,}, at most {MOST_UNSEEN:,} are allowed")
    return population


class Rows(Frozen):
    """Queries for each fabric."""

    train: StrictInt = Field(ge=1, le=10**10)  # for training, each named fabric
    population: StrictInt = Field(default=0, ge=0, le=10**10)  # for training, each member of the population
    validation: StrictInt = Field(default=2048, ge=1, le=10**10)  # for the figures on model cards, each named fabric
    test: StrictInt = Field(default=8192, ge=1, le=10**10)
    """For the benchmark, each named fabric and each of the unseen population; no model ever reads them."""


class DatasetOptions(Frozen):
    """Data set of a recipe: computed once, for all models."""

    seen: tuple[StrictStr, ...] = Field(min_length=1)
    """Fabrics to train on and measure: preset names, or paths to TOML files relative to the recipe."""
    unseen: tuple[StrictStr, ...] = ()  # fabrics that general models are measured on and never trained on
    population: Population = Population()  # random fabrics, only trained on
    unseen_population: Annotated[Population, AfterValidator(_not_too_many)] = Population()
    """Random fabrics that general models are measured on, on held-out queries, and never trained on.

    No draft of it is in the population, unless a seen fabric has it too. No design may be chosen by what is measured
    on it (CONTRIBUTING.md)."""
    rows: Rows
    shard_rows: StrictInt = Field(default=8192, ge=64, le=2**24)  # most rows of one shard, which is one task
    seed: StrictInt = Field(default=0, ge=0, lt=2**63)  # seed of all queries and points
    queries: QueryOptions = QueryOptions()
    truth: TruthOptions = TruthOptions()
    training_truth: TruthOptions | None = None
    """How training rows are answered; left out: as all others. A training averages over the noise of its rows, so many
    coarse rows give a better model than the few exact ones that take the same time."""


class ModelRecipe(Frozen):
    """A model and how it is trained; in TOML the options stand beside the table ``training``.

    An entry with the key ``recipe`` names a model of another recipe, which trains it (`jobs.recipe.trained_by`).
    """

    options: ModelOptions
    training: TrainingOptions = TrainingOptions()
    seeds: StrictInt = Field(default=1, ge=1, le=100)
    """Number of trainings: the first has the seed of its options, each further one the next higher seed."""
    runtimes: tuple[RuntimeName, ...] | None = None
    """Ways to run it that are measured too; left out: those of ``bench.runtimes``."""

    @property
    def trained_roles(self) -> frozenset[str]:
        """Roles of the fabrics that it is trained on: each named fabric by itself, or all but the unseen ones."""
        if not self.options.learns:
            return frozenset()
        return frozenset({"seen", "unseen"} if self.options.of_one_material else {"seen", "population"})

    @model_validator(mode="before")
    @classmethod
    def _split(cls, table: Any) -> Any:
        if not isinstance(table, Mapping):
            return table
        beside = {key: table[key] for key in ("training", "seeds", "runtimes") if key in table}
        return {"options": {key: value for key, value in table.items() if key not in beside}} | beside

    @model_validator(mode="after")
    def _nothing_idle(self) -> ModelRecipe:
        for key, shown in {"training": "[models.training]", "seeds": "seeds"}.items():
            if not self.options.learns and key in self.model_fields_set:
                raise ValueError(f"{self.options.model} has nothing to train: leave {shown} out")
        if self.training.seed + self.seeds > 2**63:
            raise ValueError(f"seeds, {self.seeds}, from training.seed, {self.training.seed}, on: above 2^63 - 1")
        if not self.options.learns and self.runtimes is not None:
            raise ValueError(f"{self.options.model} is no network: leave runtimes out")
        return self

    @property
    def single(self) -> list[ModelRecipe]:
        """The model with one training each, in the order of their seeds."""
        seeds = range(self.training.seed, self.training.seed + self.seeds)
        trainings = [self.training.model_copy(update={"seed": seed}) for seed in seeds]
        return [self.model_copy(update={"seeds": 1, "training": training}) for training in trainings]


class RecipeFile(Frozen):
    """A recipe's TOML file, key by key."""

    name: FileName
    about: str = Field(default="", max_length=200)
    dataset: DatasetOptions
    models: tuple[ModelRecipe, ...] = Field(default=(), max_length=32)
    bench: BenchOptions = BenchOptions()


@dataclass(frozen=True)
class Recipe:
    """A whole piece of work, validated, with its fabrics loaded in their order."""

    name: str  # names the data set and the page
    about: str  # a sentence for `twillight list`
    dataset: DatasetOptions
    models: tuple[ModelRecipe, ...]
    bench: BenchOptions
    seen: tuple[Fabric, ...]
    population: tuple[Fabric, ...]
    unseen: tuple[Fabric, ...]
    unseen_population: tuple[Fabric, ...]
    trained_by: Mapping[str, Recipe] = field(default_factory=dict)
    """From the names of models that another recipe trains to that recipe."""
    metrics: tuple[AddedMetric, ...] = ()  # metrics from outside (`jobs.recipe.added`)
    entries: tuple[Entry, ...] = ()  # answers that were computed elsewhere

    @property
    def by_role(self) -> dict[Role, tuple[Fabric, ...]]:
        """The fabrics by their roles."""
        return {
            "seen": self.seen,
            "population": self.population,
            "unseen": self.unseen,
            "unseen_population": self.unseen_population,
        }

    @property
    def fabrics(self) -> tuple[Fabric, ...]:
        """All fabrics."""
        return tuple(fabric for fabrics in self.by_role.values() for fabric in fabrics)

    @property
    def tested(self) -> tuple[tuple[Fabric, MeasuredAs], ...]:
        """The fabrics that are measured, each as seen or unseen: the named ones, then the random ones."""
        unseen = (*self.unseen, *self.unseen_population)
        return (*((fabric, "seen") for fabric in self.seen), *((fabric, "unseen") for fabric in unseen))

    @property
    def physics(self) -> dict[str, Any]:
        """The options of the truth that are its physics."""
        return {name: getattr(self.dataset.truth, name) for name in PHYSICS}

    @property
    def questions(self) -> str:
        """Fingerprint of all that held-out queries and their right answers depend on, whatever their precision."""
        dataset = self.dataset
        drawn = [versions.TRUTH, dataset.seed, dataset.rows.test, dataset.queries.model_dump(mode="json")]
        fabrics = [fabric.model_dump(mode="json", exclude={"source"}) for fabric, _ in self.tested]
        return fingerprint(["questions", *drawn, self.physics, fabrics])

    @property
    def own_models(self) -> list[ModelRecipe]:
        """The models that no other recipe trains."""
        return [model for model in self.models if model.options.name not in self.trained_by]

    @property
    def together(self) -> list[Recipe]:
        """The recipes whose rows are read: itself and those that train models of it, each once."""
        return list({id(recipe): recipe for recipe in (self, *self.trained_by.values())}.values())

    def own_rows(self) -> Iterator[tuple[Role, Fabric, Split, int]]:
        """Yield the rows of the data set: role and fabric, split, and number."""
        rows = self.dataset.rows
        named: dict[Split, int] = {"train": rows.train, "validation": rows.validation, "test": rows.test}
        population: dict[Split, int] = {"train": rows.population}
        test: dict[Split, int] = {"test": rows.test}
        # Models that other recipes train read rows of their own.
        learners = [model for model in self.own_models if model.options.learns]
        if self.models and not learners:
            named, population = test, {}
        # Only a model of one material learns from an unseen fabric; without one, there is nobody to read those rows.
        unseen = named if any(model.options.of_one_material for model in learners) else test
        splits = {"seen": named, "population": population, "unseen": unseen, "unseen_population": test}
        for role, fabrics in self.by_role.items():
            for fabric in fabrics:
                for split, total in splits[role].items():
                    yield role, fabric, split, total

    def extra_rows(self) -> Iterator[tuple[Role, Fabric, ExtraRows, int]]:
        """Yield the extra rows of the fabrics that each model is trained on; equal sets of two models once."""
        for role, fabrics in self.by_role.items():
            readers = [model for model in self.own_models if role in model.trained_roles]
            for extra in dict.fromkeys(extra for model in readers for extra in model.options.extra_rows):
                for fabric in fabrics:
                    yield role, fabric, extra, extra.count(fabric)

    def trainer_of(self, model: ModelRecipe) -> Recipe:
        """Return the recipe that trains a model: this one, unless the model names another."""
        return self.trained_by.get(model.options.name, self)
