"""`twillight check`: the files of a recipe, shards by their manifest, or invariants of a fabric's ground truth.

Exit codes: 0 all is there and sound, 1 something is missing or outdated, 2 something is cut, damaged, odd or foreign.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from jobs.exits import print_error
from jobs.plan.dataset import Shard
from jobs.plan.page import Page
from jobs.plan.plan import plan
from jobs.plan.task import STAGES, Task
from jobs.recipe.load import load_recipe
from jobs.recipe.recipe import Recipe
from jobs.recipe.shipped import recipe_names
from jobs.run.faults import Fault, faults
from jobs.run.ledger import Ledger
from jobs.terminal import MOST_SENTENCES, print_lines, print_table, progress, tracked
from jobs.verbs.parameters import NOTHING, ON, OUT, Add, On, Out, WorkerFlags
from jobs.verbs.run import work
from pipeline.shards.check import check_shard
from pipeline.shards.manifest import Manifest
from pipeline.storage import is_local, place
from weaves.errors import BadInput, WorkFailed, nearest
from weaves.fabric import Fabric, load_fabric, preset_names
from weaves.validation import read_toml

if TYPE_CHECKING:
    from pipeline.truth.invariants import CheckResult

_WHERE = "check"
_HARMLESS: Final = ("missing", "outdated")


def check(
    subject: Annotated[str, Parameter(help="Recipe, folder of a data set, or fabric.")],
    *,
    repair: Annotated[bool, Parameter(help="Make the damaged and missing files of a recipe again.")] = False,
    add: Add = NOTHING,
    out: Out = OUT,
    on: On = ON,
) -> int:
    """Check the files of a recipe, the shards of a data set, or a fabric's ground truth; return the exit code."""
    meant = _meant(subject, add)
    if isinstance(meant, Recipe):
        return _repair(meant, subject, out, on, add) if repair else _check_recipe(meant, subject, out)
    if repair:
        raise BadInput(_WHERE, "--repair", subject, "only the files of a recipe can be made again; name a recipe")
    if isinstance(meant, Fabric):
        _check_fabric(meant)
        return 0
    sentences = _check_dataset(meant)
    for sentence in sentences:
        print_error(sentence)
    return BadInput.exit_code if sentences else 0


def _meant(subject: str, add: Sequence[str]) -> Path | Recipe | Fabric:
    """Return the folder of a data set, the recipe or the fabric of a name, or BadInput.

    A folder may have any name but that of a recipe or preset. The tables of a .toml file decide what it is.
    """
    presets, recipes = preset_names(), recipe_names()
    folder = place(subject, _WHERE)
    if not is_local(folder):
        return folder
    kinds = [("preset", subject in presets), ("recipe", subject in recipes), ("folder", folder.is_dir())]
    if len(meant := [kind for kind, exists in kinds if exists]) > 1:
        # A path with a slash is never the name of a preset or a recipe.
        where = f"the folder ./{subject}" if "folder" in meant else "the path of a .toml file"
        allowed = f"is both {' and '.join(meant)}; name {where} by its path, or rename it"
        raise BadInput(_WHERE, "name", subject, allowed)
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
    """Check every shard of a data set and return the faults as sentences; without any, print a summary."""
    manifest = Manifest.load(folder)
    if not manifest.shards:
        return [f"{folder}: its manifest lists no shards; run `twillight generate`"]
    shards = manifest.shards
    sentences = [fault for shard in tracked(shards, "checking") for fault in check_shard(folder, shard, manifest)]
    if not sentences:
        print_lines(f"{folder}: {len(shards)} shards with {sum(shard.rows for shard in shards):,} rows are sound")
    return sentences


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


def _check_recipe(recipe: Recipe, name: str, out: Path) -> int:
    """Compare the files of a recipe with what its plan needs, print a sentence a fault, and return the exit code."""
    tasks = plan(recipe)
    wrong = _faults(recipe, tasks, Ledger(out))
    if any(fault.kind in ("cut", "damaged") for fault in wrong):
        print_lines(f"`twillight check {name} --repair` makes exactly these files again", stderr=True)
    elif any(fault.kind in _HARMLESS for fault in wrong):
        print_lines(f"`twillight run {name}` makes what is missing", stderr=True)
    return _end(name, tasks, wrong)


def _repair(recipe: Recipe, name: str, out: Path, on: WorkerFlags, add: Sequence[str]) -> int:
    """Remove the damaged files of a recipe, run exactly their tasks again, and return the exit code.

    Stages of which nothing was ever made are left out. Shards, weights and cards come back byte for byte; times are
    measured again, and the page that shows them is written again.
    """
    ledger = Ledger(out)
    if not ledger.exists():
        raise BadInput(str(out), "", "holds no products", f"`twillight run {name}` makes them")
    tasks = plan(recipe)
    with ledger.store.held():
        wrong = _faults(recipe, tasks, ledger)
        for fault in wrong:
            _remove(fault, ledger)
    planned, never_run = Counter(task.stage for task in tasks), Counter[str]()
    for fault in wrong:
        if fault.never_run and fault.task:
            never_run[fault.task.stage] += fault.tasks
    if any(fault.kind != "foreign" for fault in wrong):
        if stages := [stage for stage in STAGES if not 0 < never_run[stage] == planned[stage]]:
            work(name, stages, out, on, add)
        wrong = _faults(recipe, tasks, Ledger(out), "what is left:")
    return _end(name, tasks, wrong)


def _faults(recipe: Recipe, tasks: Sequence[Task], ledger: Ledger, heading: str = "") -> list[Fault]:
    """Return the faults of a recipe's files, and print a sentence each, those of damage first, up to a number."""
    with progress("checking") as advance:
        wrong = faults(recipe, tasks, ledger, advance)
    if wrong and heading:
        print_lines(heading, stderr=True)
    order = ["damaged", "cut", "odd", "foreign", "outdated", "missing"]
    ordered = sorted(wrong, key=lambda fault: order.index(fault.kind))
    for fault in ordered[:MOST_SENTENCES]:
        print_lines(f"{ledger.out / fault.path}: {fault.kind}: {fault.why}", stderr=True)
    if more := Counter(fault.kind for fault in ordered[MOST_SENTENCES:]):
        print_lines(f"and {', '.join(f'{count:,} {kind}' for kind, count in more.items())} more", stderr=True)
    return wrong


def _remove(fault: Fault, ledger: Ledger) -> None:
    """Remove what a fault is about, so that its task counts as missing; manifests are written again by each run."""
    if fault.task is None or fault.kind not in ("cut", "damaged", "missing"):
        return
    if fault.path == ledger.receipt_path(fault.task):
        ledger.store.remove(fault.path)
    ledger.discard(fault.task)
    if isinstance(fault.task, Page):  # its other files are not on the receipt
        ledger.store.remove(fault.task.products[0])


def _end(name: str, tasks: Sequence[Task], wrong: Sequence[Fault]) -> int:
    """Return the exit code of faults; without any, print what was found sound."""
    if wrong:
        return WorkFailed.exit_code if all(fault.kind in _HARMLESS for fault in wrong) else BadInput.exit_code
    parts = [task for task in tasks if isinstance(task, Shard)]
    count = Counter(task.stage for task in tasks)
    rows = sum(part.rows for part in parts)
    models = f"{count['train']:,} models, {count['bench']:,} measurements"
    print_lines(f"{name}: {len(parts):,} shards with {rows:,} rows, {models} and the page are sound")
    return 0
