"""Faults of a recipe's files: what its plan needs, compared with receipts, manifests and lists of files."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Literal, NamedTuple

from jobs.plan.dataset import DataSet, Shard
from jobs.plan.page import Page
from jobs.plan.task import Stage, Task
from jobs.recipe.recipe import Recipe
from jobs.run.ledger import CHANGED, NEVER_MADE, Ledger, reasons
from jobs.run.manifest_file import ManifestFile
from jobs.run.receipt import Receipt
from pipeline.cores import cores
from pipeline.fingerprint import file_sha256
from weaves.errors import BadInput

Kind = Literal["missing", "outdated", "cut", "damaged", "odd", "foreign"]
"""`odd`: its bytes are those that were written, but its values are not allowed. `foreign`: no task made it."""


class Fault(NamedTuple):
    """A file that is not as it should be."""

    kind: Kind
    path: str  # relative to the output folder
    why: str  # reason, a sentence about the file
    task: Task | None = None  # the task that makes it
    never_run: bool = False  # true if neither receipt nor product of the task exists
    tasks: int = 1  # number of tasks that it stands for


def faults(
    recipe: Recipe, tasks: Sequence[Task], ledger: Ledger, seen: Callable[[float], None] = lambda share: None
) -> list[Fault]:
    """Return all faults of a recipe: of its tasks in the order of the plan, then of manifests, then foreign files.

    `seen` is called with the share of the tasks whose products were read.
    """
    every: list[Fault] = []
    with ThreadPoolExecutor(cores()) as pool:
        for done, of_task in enumerate(pool.map(partial(task_faults, ledger=ledger), tasks), 1):
            every += of_task
            seen(done / len(tasks))
    every = _explained(every, tasks, ledger)
    unknown = [fault.task for fault in every if fault.task and not ledger.done(fault.task)]
    bad = {Path(path).name for task in unknown for path in task.products}
    for member in recipe.together:
        every += _manifest_faults(ManifestFile(DataSet(member), ledger), ledger.out, bad)
    return _by_stage(every, tasks) + _foreign(recipe, tasks, ledger, {fault.path for fault in every})


def task_faults(task: Task, ledger: Ledger) -> list[Fault]:
    """Return the faults of one task's receipt and products."""
    receipt = ledger.receipt(task)
    name = f"{task.stage} {task.title}"
    if receipt is None:
        note = ledger.receipt_path(task)
        if ledger.store.size(note) is not None:
            return [Fault("damaged", note, f"it is no valid receipt of {name}", task)]
        if all(ledger.store.size(path) is None for path in task.products):
            return [Fault("missing", task.products[0], f"it does not exist: {name} was not run", task, never_run=True)]
        if isinstance(task, Page):
            return [Fault("outdated", task.products[0], "it was written from other measurements or options", task)]
        return [Fault("missing", note, f"it does not exist, but products of {name} do", task)]
    wrong = [fault for path in task.products for fault in _product_faults(ledger, path, receipt, task)]
    if isinstance(task, Page) and task.products[1] not in {fault.path for fault in wrong}:
        wrong += _page_faults(task, ledger)
    if wrong:
        return wrong
    return list(_value_faults(task, ledger.out, receipt)) if isinstance(task, Shard) else []


def _product_faults(ledger: Ledger, path: str, receipt: Receipt, task: Task) -> Iterator[Fault]:
    expected, size = receipt.files.get(Path(path).name), ledger.store.size(path)
    if expected is None:
        yield Fault("outdated", path, "it is not on the receipt of its task", task)
    elif size is None:
        yield Fault("missing", path, f"it does not exist, although {task.stage} {task.title} was run", task)
    elif size < expected.bytes:
        yield Fault("cut", path, f"it has {size:,} of {expected.bytes:,} bytes", task)
    elif size > expected.bytes:
        yield Fault("damaged", path, f"it has {size:,} bytes in place of {expected.bytes:,}", task)
    else:
        yield from _byte_faults(ledger, path, expected.sha256, task)


def _page_faults(page: Page, ledger: Ledger) -> Iterator[Fault]:
    from reports.page.files import read_files

    try:
        listed = read_files(ledger.out / page.folder)
    except BadInput as error:
        yield Fault("damaged", page.products[1], f"it is {error.value}", page)
        return
    for name, sha256 in listed.items():
        path = f"{page.folder}/{name}"
        if not ledger.store.is_file(path):
            yield Fault("missing", path, "it does not exist, although the page was written", page)
        else:
            yield from _byte_faults(ledger, path, sha256, page)


def _byte_faults(ledger: Ledger, path: str, sha256: str, task: Task) -> Iterator[Fault]:
    try:
        if file_sha256(ledger.out / path) != sha256:
            yield Fault("damaged", path, "it does not have the bytes that were written (SHA-256 differs)", task)
    except OSError as error:
        if not ledger.store.is_local:
            raise  # it is the storage that fails
        yield Fault("damaged", path, f"it cannot be read ({error.strerror})", task)


def _value_faults(part: Shard, out: Path, receipt: Receipt) -> Iterator[Fault]:
    """Yield the values of a shard that are not allowed."""
    from pipeline.shards.check import check_values

    path = out / part.products[0]
    for fault in check_values(path, part.entry(receipt.files[path.name].sha256), part.shard.fabric.weave.repeat):
        yield Fault("odd", part.products[0], fault.removeprefix(f"{path}: "), part)


def _manifest_faults(file: ManifestFile, out: Path, bad: set[str]) -> Iterator[Fault]:
    """Yield the fault of a manifest; shards in the files `bad`, whose hashes no receipt has, are not compared."""
    from pipeline.shards.manifest import FILE, Manifest

    expected, path = file.content(), file.folder / FILE
    where = str(path.relative_to(out))
    if not path.exists():
        if expected.shards:
            yield Fault("missing", where, "it does not exist, although shards of its data set do")
        return
    try:
        manifest = Manifest.load(file.folder)
        whole = path.read_bytes() == manifest.encoded()
    except BadInput:
        yield Fault("damaged", where, "it is no manifest")
        return
    listed, done = manifest.without(bad), expected.without(bad)
    if not whole or manifest.model_copy(update={"shards": expected.shards}).encoded() != expected.encoded():
        yield Fault("damaged", where, "it does not say what the plan says")
    elif not set(listed.shards) <= set(done.shards):
        yield Fault("damaged", where, "it does not say what the receipts say")
    elif len(listed.shards) < len(done.shards):
        yield Fault("outdated", where, f"it lists {len(listed.shards):,} of {len(done.shards):,} finished shards")


def _explained(found: Sequence[Fault], tasks: Sequence[Task], ledger: Ledger) -> list[Fault]:
    """Call the products of tasks that were run with another identity outdated, and name what has changed."""
    if not any(fault.never_run or fault.kind == "outdated" for fault in found):
        return list(found)
    why, result = reasons(tasks, ledger), []
    for fault in found:
        reason = why.get(fault.task.id, NEVER_MADE) if fault.task else NEVER_MADE
        if reason.startswith(CHANGED) and (fault.never_run or fault.kind == "outdated"):
            fault = fault._replace(kind="outdated", why=f"it was made before; {reason}")
        elif fault.never_run and reason != NEVER_MADE:
            fault = fault._replace(why=f"{fault.why}; {reason}")
        result.append(fault)
    return result


def _by_stage(found: Sequence[Fault], tasks: Sequence[Task]) -> list[Fault]:
    """Replace the faults of a stage none of whose tasks was run by one fault."""
    planned = Counter(task.stage for task in tasks)
    never = Counter(fault.task.stage for fault in found if fault.task and fault.never_run)
    whole = {stage for stage, count in never.items() if count == planned[stage] > 1}
    result: list[Fault] = []
    told: set[Stage] = set()
    for fault in found:
        stage = fault.task.stage if fault.task else None
        if stage not in whole:
            result.append(fault)
        elif stage is not None and stage not in told:
            told.add(stage)
            why = f"it does not exist, nor does any product of the {never[stage]:,} tasks of {stage}"
            why += f"; {fault.why}" if fault.kind == "outdated" else ""
            result.append(fault._replace(why=why, tasks=never[stage]))
    return result


def _foreign(recipe: Recipe, tasks: Sequence[Task], ledger: Ledger, faulty: Set[str]) -> list[Fault]:
    """Return the files in the recipe's own folders that no task made: data sets, models, pages with a sound list."""
    folders = {str(Path(path).parent) for task in tasks if task.stage != "bench" for path in task.products}
    for page in (task for task in tasks if isinstance(task, Page)):
        if not faulty.isdisjoint({page.products[1], ledger.receipt_path(page)}):
            folders.discard(page.folder)
    named = {path for path in ledger.store.below(folders) if not is_leftover(Path(path).name)}
    foreign = sorted(named - set(own_files(recipe, tasks, ledger.out)))
    return [Fault("foreign", path, "no task of this recipe made it") for path in foreign]


def own_files(recipe: Recipe, tasks: Sequence[Task], out: Path) -> Iterator[str]:
    """Yield the files of a recipe's data sets, models, measurements and page, whether they exist or not."""
    from pipeline.shards.manifest import FILE

    for dataset in map(DataSet, recipe.together):
        yield from (path for part in dataset.shards for path in part.products)
        yield f"{dataset.folder}/{FILE}"
    for task in tasks:
        yield from task.products
        if isinstance(task, Page):
            yield f"{task.folder}/results.md"  # of `twillight results`
            with suppress(BadInput):  # its list of files is damaged
                yield from task.written(out)


def is_leftover(name: str) -> bool:
    """Return whether a file is what a stopped task leaves: no reader looks at it, and the next run replaces it."""
    return name.startswith(".tmp-") or name == "checkpoint.safetensors"
