"""`twillight check`: a folder of shards by its manifest, or physical invariants of a fabric's ground truth.

A recipe is checked by `jobs.verbs.check_recipe`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter
from rich.progress import track
from rich.table import Table

from jobs.console import table_of
from jobs.exits import print_error
from jobs.recipe.load import load_recipe, recipe_names
from jobs.recipe.recipe import Recipe
from jobs.terminal import Terminal
from jobs.verbs.parameters import NOTHING, ON, OUT, Add, On, Out
from pipeline.shards.check import check_shard
from pipeline.shards.manifest import Manifest
from pipeline.storage import is_local, place
from weaves.errors import BadInput, WorkFailed, nearest
from weaves.fabric import Fabric, load_fabric, preset_names
from weaves.validation import read_toml

WHERE = "check"


def check(
    subject: Annotated[str, Parameter(help="Recipe, folder of a data set, or fabric.")],
    *,
    repair: Annotated[bool, Parameter(help="Make the damaged and missing files of a recipe again.")] = False,
    add: Add = NOTHING,
    out: Out = OUT,
    on: On = ON,
) -> int:
    """Check the files of a recipe, the shards of a data set, or a fabric's ground truth; return the exit code."""
    found = resolve(subject, add)
    if isinstance(found, Recipe):
        from jobs.verbs import check_recipe

        return check_recipe.repair(subject, out, on, add) if repair else check_recipe.check_recipe(subject, out, add)
    if repair:
        raise BadInput(WHERE, "--repair", subject, "only the files of a recipe can be made again; name a recipe")
    if isinstance(found, Fabric):
        check_fabric(found)
        return 0
    faults = check_dataset(found)
    for fault in faults:
        print_error(fault)
    return BadInput.exit_code if faults else 0


def resolve(subject: str, add: Sequence[str] = ()) -> Path | Recipe | Fabric:
    """Return the subject of a name: the folder of a data set, a recipe, or a fabric.

    A folder may have any name but that of a recipe or preset. The tables of a .toml file decide what it is. `add` has
    the methods from outside that a recipe may name.

    Raises
    ------
    BadInput
        If nothing or more than one thing has this name, or the file cannot be used.
    """
    presets, recipes = preset_names(), recipe_names()
    folder = place(subject, WHERE)
    if not is_local(folder):
        return folder
    kinds = [("preset", subject in presets), ("recipe", subject in recipes), ("folder", folder.is_dir())]
    if len(meant := [kind for kind, found in kinds if found]) > 1:
        # A path with a slash is never the name of a preset or a recipe.
        where = f"{'the folder ./' + subject if 'folder' in meant else 'the path of a .toml file'}"
        raise BadInput(WHERE, "name", subject, f"is both {' and '.join(meant)}; name {where} by its path, or rename it")
    match meant:
        case ["folder"]:
            return folder
        case ["preset"]:
            return load_fabric(subject)
        case ["recipe"]:
            return load_recipe(subject, add)
    if not subject.endswith(".toml"):
        allowed = "a recipe, a folder of a data set or a fabric is needed"
        raise BadInput(WHERE, "name", subject, f"{allowed}; {nearest(subject, [*recipes, *presets])}")
    tables = read_toml(Path(subject)).keys() & {"dataset", "draft"}
    if len(tables) != 1:
        found = "has both [dataset] and [draft]" if tables else "has neither [dataset] nor [draft]"
        raise BadInput(subject, "", found, "a recipe has the one, a fabric the other")
    return load_fabric(subject) if "draft" in tables else load_recipe(subject, add)


def check_dataset(folder: Path) -> list[str]:
    """Check every shard of a data set and return the faults as sentences; without any, print a summary.

    Raises
    ------
    BadInput
        If the folder has no manifest.
    """
    manifest = Manifest.load(folder)
    if not manifest.shards:
        return [f"{folder}: its manifest lists no shards; run `twillight generate`"]
    console = Terminal(stderr=True)
    faults = []
    for entry in track(manifest.shards, "checking", console=console, disable=not console.is_terminal):
        faults += check_shard(folder, entry, manifest)
    rows = sum(entry.rows for entry in manifest.shards)
    if not faults:
        Terminal().print(f"{folder}: {len(manifest.shards)} shards with {rows:,} rows are sound")
    return faults


def check_fabric(fabric: Fabric) -> None:
    """Test a fabric's ground truth against physical invariants and print a table.

    Raises
    ------
    WorkFailed
        If an invariant does not hold.
    """
    from pipeline.truth.checks.invariants import INVARIANTS

    console = Terminal(stderr=True)
    found = []
    for invariant in track(INVARIANTS, "checking", console=console, disable=not console.is_terminal, transient=True):
        found += invariant(fabric)
    Terminal().print(invariants_table(fabric.name, found))
    if broken := [item.name for item in found if item.status == "broken"]:
        raise WorkFailed(f"{fabric.name}: {len(broken)} of {len(found)} invariants do not hold: {', '.join(broken)}")


def invariants_table(name: str, found: Sequence[Any]) -> Table:
    """Show the invariants of a fabric (a sequence of `pipeline.truth.checks.invariants.CheckResult`)."""
    table = table_of("invariant", "value", "should be", "holds", "", right=("value",))
    for item in found:
        style = "bold red" if item.status == "broken" else ""
        table.add_row(item.name, _measured(item), _should_be(item), _holds(item), item.note, style=style)
    table.title, table.title_justify = name, "left"
    return table


def _measured(item: Any) -> str:
    value = f"{item.measured:.4g}"
    return f"{value} ± {item.standard_error:.1g}" if item.standard_error else value


def _should_be(item: Any) -> str:
    return "–" if item.relation == "reported" else f"{item.relation} {item.expected:g}"


def _holds(item: Any) -> str:
    inside = item.relation == "<=" and item.sigmas < -5
    match item.status:
        case "exact":
            return "exactly"
        case "statistics":
            return f"by {-item.sigmas:.0f} σ" if inside else f"within statistics ({item.sigmas:+.1f} σ)"
        case "broken":
            return f"NO ({item.sigmas:+.1f} σ)" if item.standard_error else "NO"
    return "a number only"
