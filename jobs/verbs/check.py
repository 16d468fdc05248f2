"""`twillight check`: a folder of shards by its manifest, or physical invariants of a fabric's ground truth.

A recipe is checked by `jobs.verbs.check_recipe`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from jobs.exits import print_error
from jobs.recipe.load import load_recipe
from jobs.recipe.recipe import Recipe
from jobs.recipe.shipped import recipe_names
from jobs.terminal import print_lines, print_table, tracked
from jobs.verbs.parameters import NOTHING, ON, OUT, Add, On, Out
from pipeline.shards.check import check_shard
from pipeline.shards.manifest import Manifest
from pipeline.storage import is_local, place
from weaves.errors import BadInput, WorkFailed, nearest
from weaves.fabric import Fabric, load_fabric, preset_names
from weaves.validation import read_toml

if TYPE_CHECKING:
    from pipeline.truth.invariants import CheckResult

_WHERE = "check"


def check(
    subject: Annotated[str, Parameter(help="Recipe, folder of a data set, or fabric.")],
    *,
    repair: Annotated[bool, Parameter(help="Make the damaged and missing files of a recipe again.")] = False,
    add: Add = NOTHING,
    out: Out = OUT,
    on: On = ON,
) -> int:
    """Check the files of a recipe, the shards of a data set, or a fabric's ground truth; return the exit code."""
    meant = resolve(subject, add)
    if isinstance(meant, Recipe):
        from jobs.verbs import check_recipe

        return check_recipe.repair(subject, out, on, add) if repair else check_recipe.check_recipe(subject, out, add)
    if repair:
        raise BadInput(_WHERE, "--repair", subject, "only the files of a recipe can be made again; name a recipe")
    if isinstance(meant, Fabric):
        _check_fabric(meant)
        return 0
    faults = _check_dataset(meant)
    for fault in faults:
        print_error(fault)
    return BadInput.exit_code if faults else 0


def resolve(subject: str, add: Sequence[str] = ()) -> Path | Recipe | Fabric:
    """Return the subject of a name: the folder of a data set, a recipe, or a fabric.

    A folder may have any name but that of a recipe or preset. The tables of a .toml file decide what it is. `add` has
    the methods from outside that a recipe may name. BadInput if nothing or more than one thing has this name, or the
    file cannot be used.
    """
    presets, recipes = preset_names(), recipe_names()
    folder = place(subject, _WHERE)
    if not is_local(folder):
        return folder
    kinds = [("preset", subject in presets), ("recipe", subject in recipes), ("folder", folder.is_dir())]
    if len(meant := [kind for kind, exists in kinds if exists]) > 1:
        # A path with a slash is never the name of a preset or a recipe.
        where = f"{'the folder ./' + subject if 'folder' in meant else 'the path of a .toml file'}"
        raise BadInput(
            _WHERE, "name", subject, f"is both {' and '.join(meant)}; name {where} by its path, or rename it"
        )
    match meant:
        case ["folder"]:
            return folder
        case ["preset"]:
            return load_fabric(subject)
        case ["recipe"]:
            return load_recipe(subject, add)
    if not subject.endswith(".toml"):
        allowed = "a recipe, a folder of a data set or a fabric is needed"
        raise BadInput(_WHERE, "name", subject, f"{allowed}; {nearest(subject, [*recipes, *presets])}")
    tables = read_toml(Path(subject)).keys() & {"dataset", "draft"}
    if len(tables) != 1:
        which = "has both [dataset] and [draft]" if tables else "has neither [dataset] nor [draft]"
        raise BadInput(subject, "", which, "a recipe has the one, a fabric the other")
    return load_fabric(subject) if "draft" in tables else load_recipe(subject, add)


def _check_dataset(folder: Path) -> list[str]:
    """Check every shard of a data set and return the faults as sentences; without any, print a summary.

    BadInput if the folder has no manifest.
    """
    manifest = Manifest.load(folder)
    if not manifest.shards:
        return [f"{folder}: its manifest lists no shards; run `twillight generate`"]
    faults = [fault for entry in tracked(manifest.shards, "checking") for fault in check_shard(folder, entry, manifest)]
    if not faults:
        rows = sum(entry.rows for entry in manifest.shards)
        print_lines(f"{folder}: {len(manifest.shards)} shards with {rows:,} rows are sound")
    return faults


def _check_fabric(fabric: Fabric) -> None:
    """Test a fabric's ground truth against physical invariants and print a table; WorkFailed if one does not hold."""
    from pipeline.truth.invariants import INVARIANTS

    results = [result for invariant in tracked(INVARIANTS, "checking") for result in invariant(fabric)]
    rows = []
    for result in results:
        value = f"{result.measured:.4g}" + (f" ± {result.standard_error:.1g}" if result.standard_error else "")
        wanted = "–" if result.relation == "reported" else f"{result.relation} {result.expected:g}"
        rows.append((result.name, value, wanted, _holds(result), result.note))
    broken = {index: "bold red" for index, result in enumerate(results) if result.status == "broken"}
    columns = ("invariant", "value", "should be", "holds", "")
    print_table(columns, rows, text=("should be", "holds", ""), title=fabric.name, styles=broken)
    if broken:
        names = ", ".join(results[index].name for index in broken)
        raise WorkFailed(f"{fabric.name}: {len(broken)} of {len(results)} invariants do not hold: {names}")


def _holds(result: CheckResult) -> str:
    match result.status:
        case "exact":
            return "exactly"
        case "statistics" if result.relation == "<=" and result.sigmas < -5:
            return f"by {-result.sigmas:.0f} σ"
        case "statistics":
            return f"within statistics ({result.sigmas:+.1f} σ)"
        case "broken":
            return f"NO ({result.sigmas:+.1f} σ)" if result.standard_error else "NO"
    return "a number only"
