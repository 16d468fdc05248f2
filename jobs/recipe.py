"""Recipes: which fabrics, how many rows, which models, which measurements; TOML in, a frozen Recipe out.

Three kinds of fabrics: `seen` ones are named, trained on and measured; members of the `population` are drawn at random
and only trained on; `unseen` ones are only measured. An unseen fabric has training rows too when a model of a single
material (`neumip`) is in the recipe, and no other model ever reads them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, StrictInt, StrictStr, model_validator

from jobs.contradictions import refuse_contradictions
from jobs.teachers import refuse_unlike, with_teachers
from pipeline.models.options import ModelOptions
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.shipped import SHIPPED
from pipeline.shards.queries import QueryOptions
from pipeline.training.options import TrainingOptions
from pipeline.truth.options import TruthOptions
from reports.options import BenchOptions, RuntimeName
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric, load_fabric, preset_names
from weaves.population import Population, population_fabrics
from weaves.validation import read_toml, validated

RECIPES = Path(__file__).parent / "recipes"


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


class Rows(_Section):
    """Queries for each fabric."""

    train: StrictInt = Field(ge=1, le=10**10)
    """For training, each named fabric."""
    population: StrictInt = Field(default=0, ge=0, le=10**10)
    """For training, each member of the population."""
    validation: StrictInt = Field(default=2048, ge=1, le=10**10)
    """For the figures on model cards, each named fabric."""
    test: StrictInt = Field(default=8192, ge=1, le=10**10)
    """For the benchmark, each named fabric; no model ever reads them."""


class DatasetOptions(_Section):
    """What is computed once, for all models."""

    seen: tuple[StrictStr, ...] = Field(min_length=1)
    """Fabrics to train on and measure: preset names, or paths to TOML files relative to the recipe."""
    unseen: tuple[StrictStr, ...] = ()
    """Fabrics that general models are measured on and never trained on."""
    population: Population = Population()
    """Random fabrics, only trained on."""
    rows: Rows
    """Queries for each fabric."""
    shard_rows: StrictInt = Field(default=8192, ge=64, le=2**24)
    """Most rows of one shard, which is one task."""
    seed: StrictInt = Field(default=0, ge=0, lt=2**63)
    """Seed of all queries and points."""
    queries: QueryOptions = QueryOptions()
    """Distribution of the queries."""
    truth: TruthOptions = TruthOptions()
    """How they are answered."""
    training_truth: TruthOptions | None = None
    """How training rows are answered; left out: as all others. A training averages noise away that a measurement must
    not have, so that for the same time many coarse rows teach more than few fine ones."""

    def truth_of(self, split: str) -> TruthOptions:
        """Return how the rows of a split are answered."""
        return self.training_truth or self.truth if split == "train" else self.truth


class ModelRecipe(_Section):
    """A model and how it is trained; in TOML the options stand beside the table ``training``.

    An entry with the key ``recipe`` names a model of another recipe, which trains it (`jobs.teachers`).
    """

    options: ModelOptions
    """The design."""
    training: TrainingOptions = TrainingOptions()
    """How it is trained."""
    runtimes: tuple[RuntimeName, ...] | None = None
    """Ways to run it that are measured too; left out: those of ``bench.runtimes``."""

    @property
    def of_one_material(self) -> bool:
        """Whether a trained model knows a single fabric."""
        return self.options.of_one_material

    @property
    def learns(self) -> bool:
        """Whether there is anything to train."""
        return self.options.learns

    @model_validator(mode="before")
    @classmethod
    def _split(cls, table: Any) -> Any:
        if not isinstance(table, Mapping):
            return table
        beside = {key: table[key] for key in ("training", "runtimes") if key in table}
        return {"options": {key: value for key, value in table.items() if key not in beside}} | beside

    @model_validator(mode="after")
    def _nothing_idle(self) -> ModelRecipe:
        if not self.learns and "training" in self.model_fields_set:
            raise ValueError(f"{self.options.model} has nothing to train: leave [models.training] out")
        if not self.learns and self.runtimes is not None:
            raise ValueError(f"{self.options.model} is no network: leave runtimes out")
        return self

    def measured(self, bench: BenchOptions) -> BenchOptions:
        """Return what is measured of this model: ways to run a network are no matter of the others."""
        runtimes = (bench.runtimes if self.runtimes is None else self.runtimes) if self.learns else ()
        return bench.model_copy(update={"runtimes": runtimes})


class _File(_Section):
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,59}$")]
    about: str = Field(default="", max_length=200)
    dataset: DatasetOptions
    models: tuple[ModelRecipe, ...] = Field(default=(), max_length=32)
    bench: BenchOptions = BenchOptions()


@dataclass(frozen=True)
class Recipe:
    """A whole piece of work, validated, with its fabrics loaded.

    Attributes
    ----------
    name, about : str
        Names the data set and the page; a sentence for `twillight list`.
    dataset : DatasetOptions
        Rows, queries and truth.
    models : tuple of ModelRecipe
        Designs and trainings.
    bench : BenchOptions
        Measurements.
    seen, population, unseen : tuple of Fabric
        The fabrics in the order of the recipe.
    teachers : mapping
        From the names of models that another recipe trains to that recipe.
    """

    name: str
    about: str
    dataset: DatasetOptions
    models: tuple[ModelRecipe, ...]
    bench: BenchOptions
    seen: tuple[Fabric, ...]
    population: tuple[Fabric, ...]
    unseen: tuple[Fabric, ...]
    teachers: Mapping[str, Recipe] = field(default_factory=dict)

    @property
    def fabrics(self) -> tuple[Fabric, ...]:
        """All fabrics."""
        return self.seen + self.population + self.unseen

    @property
    def own_models(self) -> list[ModelRecipe]:
        """The models that no other recipe trains."""
        return [model for model in self.models if model.options.name not in self.teachers]

    @property
    def together(self) -> list[Recipe]:
        """The recipes whose rows are read: itself and those that train models of it, each once."""
        return list({id(recipe): recipe for recipe in (self, *self.teachers.values())}.values())

    def teacher_of(self, model: ModelRecipe) -> Recipe:
        """Return the recipe that trains a model: this one, unless the model names another."""
        return self.teachers.get(model.options.name, self)


def recipe_names() -> list[str]:
    """Return the names of the recipes that come with the package."""
    return sorted(path.stem for path in RECIPES.glob("*.toml"))


def load_recipe(name_or_path: str | Path) -> Recipe:
    """Read a recipe.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a recipe of the package, or path of a TOML file (ending in ``.toml``).

    Raises
    ------
    BadInput
        If there is no such recipe, or anything in it or in its fabrics cannot be used.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        if str(name_or_path) not in (known := recipe_names()):
            allowed = f"a path ending in .toml or a recipe's name is needed; {nearest(str(name_or_path), known)}"
            raise BadInput("recipe", "name", str(name_or_path), allowed)
        path = RECIPES / f"{name_or_path}.toml"
    return _load(path, ())


def _load(path: Path, asking: tuple[Path, ...]) -> Recipe:
    """Read a recipe for those that ask for it, each of which is named in the one before."""
    where, read = str(path), dict[Path, Recipe]()

    def load(name: object, key: str) -> Recipe:
        found = _beside(path, name, key)
        if found in read:
            return read[found]
        chain = (*asking, path, found)
        if found.resolve() in [one.resolve() for one in chain[:-1]]:
            told = " → ".join(one.stem for one in chain)
            raise BadInput(where, key, name, f"recipes must not wait for one another: {told}")
        read[found] = _load(found, chain[:-1])
        return read[found]

    content, teachers = with_teachers(read_toml(path), where, load)
    file = validated(_File, content, where)
    dataset = file.dataset
    recipe = Recipe(
        file.name,
        file.about,
        dataset,
        file.models,
        _with_scenes(file.bench, path),
        seen=tuple(_fabrics(dataset.seen, path, "dataset.seen")),
        population=tuple(population_fabrics(dataset.population)),
        unseen=tuple(_fabrics(dataset.unseen, path, "dataset.unseen")),
        teachers=teachers,
    )
    refuse_contradictions(recipe, where)
    refuse_unlike(recipe, where)
    return recipe


def _beside(recipe: Path, name: object, key: str) -> Path:
    """Return the path of a recipe that another one names: of the package, or beside it."""
    if name in (known := recipe_names()):
        return RECIPES / f"{name}.toml"
    if isinstance(name, str) and name.endswith(".toml") and "\0" not in name and (recipe.parent / name).is_file():
        return recipe.parent / name
    allowed = f"a recipe's name or the path of a .toml file beside this one is needed; {nearest(str(name), known)}"
    raise BadInput(str(recipe), key, name, allowed)


def _fabrics(names: Sequence[str], recipe: Path, key: str) -> Iterator[Fabric]:
    """Load the fabrics that a recipe names."""
    for index, name in enumerate(names):
        known = preset_names()
        if name in known:
            yield load_fabric(name)
        elif name.endswith(".toml") and "\0" not in name and (path := recipe.parent / name).is_file():
            yield load_fabric(path)
        else:
            allowed = f"a preset or the path of a .toml file beside the recipe is needed; {nearest(name, known)}"
            raise BadInput(str(recipe), f"{key}.{index}", name, allowed)


def _with_scenes(bench: BenchOptions, recipe: Path) -> BenchOptions:
    """Return measurements whose scenes are there, paths being found from wherever the recipe is read."""
    found = []
    for index, name in enumerate(bench.scenes.names):
        path = recipe.parent / name if "\0" not in name else Path()
        if name not in SHIPPED and not (path.suffix in (".toml", ".xml") and path.is_file()):
            allowed = "a scene of the package or the path of a .toml or .xml file beside the recipe is needed; "
            raise BadInput(str(recipe), f"bench.scenes.names.{index}", name, allowed + nearest(name, SHIPPED))
        found.append(name if name in SHIPPED else str(path.resolve()))
    scenes = [load_scene(name).name for name in found]
    for index, name in enumerate(scenes):
        if name in scenes[:index]:
            allowed = "names of scenes must differ, because files are called by them"
            raise BadInput(str(recipe), f"bench.scenes.names.{index}", name, allowed)
    return bench.model_copy(update={"scenes": bench.scenes.model_copy(update={"names": tuple(found)})})
