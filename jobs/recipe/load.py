"""Loading a recipe: TOML in, a frozen Recipe out; files that it names are found, contradictions are refused."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from jobs.recipe.added import Added
from jobs.recipe.entry import Entry, read_entry
from jobs.recipe.recipe import Recipe, RecipeFile
from jobs.recipe.shipped import RECIPES, recipe_names
from jobs.recipe.trained_by import check_trained_by, with_trained_by
from jobs.recipe.validation import validate_recipe
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.shipped import SHIPPED
from reports.options import BenchOptions
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric, load_fabric, preset_names
from weaves.population import population_fabrics
from weaves.validation import read_toml, validated

_MEASURED_BY: Final = {"stability": "truth", "sampler": "truth"}  # of what was once measured without a recipe
_MOST_RECIPES: Final = 32


def load_recipe(name_or_path: str | Path, add: Sequence[str] = ()) -> Recipe:
    """Read a recipe of the package by its name, or a TOML file by its path, which ends in ``.toml``.

    Methods, metrics and answers from outside the package are in `add` (`jobs.recipe.added`). BadInput if there is no
    such recipe, or anything in it, in its fabrics or among `add` cannot be used.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        if recipe := _MEASURED_BY.get(str(name_or_path)):
            allowed = f"is measured by the recipe {recipe}: `twillight run {recipe}`"
            raise BadInput("recipe", "name", str(name_or_path), allowed)
        if str(name_or_path) not in (known := recipe_names()):
            allowed = f"a path ending in .toml or a recipe's name is needed; {nearest(str(name_or_path), known)}"
            raise BadInput("recipe", "name", str(name_or_path), allowed)
        path = RECIPES / f"{name_or_path}.toml"
    return _load(path, (), {}, Added(add))


def _load(path: Path, chain: tuple[Path, ...], read: dict[Path, Recipe], added: Added) -> Recipe:
    """Read a recipe; `chain` has the recipes that led to it, each named in the one before, `read` those loaded."""
    where = str(path)

    def load(name: object, key: str) -> Recipe:
        what = "a recipe's name or the path of a .toml file beside this one"
        other = _beside(name, recipe_names(), path, key, what) or RECIPES / f"{name}.toml"
        if (real := other.resolve()) in read:
            return read[real]
        named = (*chain, path, other)
        if real in [earlier.resolve() for earlier in named[:-1]]:
            circle = " → ".join(link.stem for link in named)
            raise BadInput(where, key, name, f"recipes must not wait for one another: {circle}")
        if len(chain) + len(read) >= _MOST_RECIPES:
            raise BadInput(
                where, key, name, f"at most {_MOST_RECIPES} recipes may be named, directly or through others"
            )
        read[real] = _load(other, named[:-1], read, added)
        return read[real]

    content, trained_by = read_toml(path), dict[str, Recipe]()
    if isinstance(entries := content.get("models", []), list):
        entered = added.entered(entries, where, all_given=not chain)
        content["models"], trained_by = with_trained_by(entered, where, load)
    file = validated(RecipeFile, content, where)
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
        unseen_population=tuple(population_fabrics(dataset.unseen_population, "unseen_{index}_{family}")),
        trained_by=trained_by,
        metrics=() if chain else tuple(added.metrics),
    )
    validate_recipe(recipe, where)
    check_trained_by(recipe, where)
    return recipe if chain else replace(recipe, entries=tuple(_entries(recipe, added.forms)))


def _entries(recipe: Recipe, forms: Sequence[Path]) -> Iterator[Entry]:
    taken = [model.options.name for model in recipe.models]
    for path in forms:
        entry = read_entry(path, recipe.questions, len(recipe.tested) * recipe.dataset.rows.test)
        if entry.form.name in taken:
            raise BadInput(str(path), "name", entry.form.name, "is the name of a model or of another entry")
        taken.append(entry.form.name)
        yield entry


def _beside(
    name: object, known: Collection[str], recipe: Path, key: str, what: str, endings: tuple[str, ...] = (".toml",)
) -> Path | None:
    """Return the path of a file beside a recipe that names it; None if the name is one of the package."""
    if name in known:
        return None
    if isinstance(name, str) and name.endswith(endings) and "\0" not in name and (recipe.parent / name).is_file():
        return recipe.parent / name
    raise BadInput(str(recipe), key, name, f"{what} is needed; {nearest(str(name), known)}")


def _fabrics(names: Sequence[str], recipe: Path, key: str) -> Iterator[Fabric]:
    known, what = preset_names(), "a preset or the path of a .toml file beside the recipe"
    for index, name in enumerate(names):
        yield load_fabric(_beside(name, known, recipe, f"{key}.{index}", what) or name)


def _with_scenes(bench: BenchOptions, recipe: Path) -> BenchOptions:
    """Return measurements whose scenes are there, paths being found from wherever the recipe is read."""
    key, what = "bench.scenes.names", "a scene of the package or the path of a .toml or .xml file beside the recipe"
    references = []
    for index, name in enumerate(bench.scenes.names):
        path = _beside(name, SHIPPED, recipe, f"{key}.{index}", what, (".toml", ".xml"))
        references.append(str(path.resolve()) if path else name)
    scenes = [load_scene(name).name for name in references]
    for index, name in enumerate(scenes):
        if name in scenes[:index]:
            allowed = "names of scenes must differ, because files are called by them"
            raise BadInput(str(recipe), f"{key}.{index}", name, allowed)
    return bench.model_copy(update={"scenes": bench.scenes.model_copy(update={"names": tuple(references)})})
