"""`twillight merge`: two folders of products become one, such as parts of a data set made on two machines.

`twillight records merge` joins the Records of machines alone, with the times of each machine apart.

Shards, models and Records are compared with their receipts and linked, or copied where there are no links. Pages are
left out: the next run writes them from what is there then.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from cyclopts import Parameter

from jobs.console import MOST_SENTENCES, number, print_line, table_of
from jobs.plan.dataset import DATASETS
from jobs.run.ledger import Ledger
from jobs.run.receipt import Product, Receipt
from jobs.run.store import LEDGER
from jobs.terminal import Terminal
from jobs.verbs.compare import records_file
from jobs.verbs.parameters import Local, OfSeveralPages
from pipeline.atomic import link
from pipeline.fingerprint import file_sha256
from weaves.errors import BadInput

if TYPE_CHECKING:
    from rich.table import Table

    from pipeline.shards.manifest import Manifest
    from reports.record import Record

_RECORDS = "records merge"


class MergedTask(NamedTuple):
    """A finished task in one folder."""

    ledger: Ledger
    receipt: Receipt
    places: list[str]
    """Paths of its sound products, relative to the folder."""


def merge(
    a: Annotated[Local, Parameter(help="Folder of products.")],
    b: Annotated[Local, Parameter(help="Another one, for example of another machine.")],
    *,
    out: Annotated[Local, Parameter(help="Folder of all products; created if need be.")],
) -> int:
    """Join two folders of products in `out`, which may hold products itself; return the exit code.

    Raises
    ------
    BadInput
        If a folder holds no products, two hold other bytes of the same task, or `out` cannot be written.
    WorkFailed
        If a run is at work in `out`.
    """
    sources = a, b
    for source in sources:
        if not (source / "ledger").is_dir():
            raise BadInput(str(source), "", "holds no products", "the output folder of a run is needed")
    target = Ledger(out)
    with target.store.held():
        others = [Ledger(source) for source in sources if source.resolve() != out.resolve()]
        chosen: dict[str, MergedTask] = {}
        damaged: dict[str, str] = {}
        for ledger in (target, *others):
            for receipt in ledger.receipts([]):
                if receipt.stage == "report":
                    continue
                part = MergedTask(ledger, receipt, list(_sound(ledger, receipt)))
                if {Path(place).name for place in part.places} != receipt.files.keys():
                    damaged[receipt.task] = f"{ledger.out}: {receipt.stage} {receipt.title}"
                elif receipt.task not in chosen:
                    chosen[receipt.task] = part
                else:
                    _refuse_conflict(chosen[receipt.task], part)
        manifests = _manifests([target, *others], out)
        for part in chosen.values():
            if part.ledger is not target:
                for place in part.places:
                    link(part.ledger.out / place, out / place)
                target.store.write(f"{LEDGER}/{part.receipt.task}.json", part.receipt.encoded())
        for folder, manifest in manifests.items():
            there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
            manifest.without({shard.file for shard in manifest.shards} - there).save(folder)
    left = [damaged[task] for task in sorted(damaged.keys() - chosen.keys())]
    for task in left[:MOST_SENTENCES]:
        print_line(f"{task}: a product is missing or damaged; it is left out")
    if len(left) > MOST_SENTENCES:
        print_line(f"and {len(left) - MOST_SENTENCES:,} more")
    counts = Counter(str(part.ledger.out) for part in chosen.values())
    found = ", ".join(f"{counts[str(ledger.out)]:,} from {ledger.out}" for ledger in others)
    said = f"{out}: {len(chosen):,} finished tasks, {found}; `twillight run` goes on"
    Terminal().print(said, soft_wrap=True)
    return BadInput.exit_code if left else 0


def _sound(ledger: Ledger, receipt: Receipt) -> Iterator[str]:
    """Yield the paths of a receipt's products whose bytes are those that were written."""
    for place in ledger.places(receipt):
        expected = receipt.files[Path(place).name]
        if (ledger.out / place).stat().st_size == expected.bytes and file_sha256(ledger.out / place) == expected.sha256:
            yield place


def _refuse_conflict(first: MergedTask, second: MergedTask) -> None:
    """Refuse two products of one task with unlike bytes; the machine and the date beside Records do not count."""
    pairs = [_numbers(part.receipt.files) for part in (first, second)]
    if pairs[0] != pairs[1]:
        name = next(name for name in sorted(pairs[0]) if pairs[0][name] != pairs[1].get(name))
        task = f"{first.receipt.stage} {first.receipt.title}"
        allowed = f"delete ledger/{first.receipt.task}.json in the folder whose product is not wanted"
        where = f"{first.ledger.out} and {second.ledger.out}"
        raise BadInput(where, "", f"{name} of {task} has other bytes in each", allowed)


def _numbers(files: dict[str, Product]) -> dict[str, Product]:
    return {name: product for name, product in files.items() if not name.endswith(".machine.json")}


def _manifests(ledgers: Sequence[Ledger], out: Path) -> dict[Path, Manifest]:
    """Return by folder in `out` the manifests of all data sets, each with the shards of all folders."""
    from pipeline.shards.manifest import FILE, Manifest

    found: dict[Path, Manifest] = {}
    for ledger in ledgers:
        for path in sorted(ledger.out.glob(f"{DATASETS}/*/{FILE}")):
            manifest, folder = Manifest.load(path.parent), out / path.parent.relative_to(ledger.out)
            if folder not in found:
                found[folder] = manifest
                continue
            before = found[folder]
            every = {shard.file: shard for shard in (*before.shards, *manifest.shards)}
            if before.model_copy(update={"shards": manifest.shards}).encoded() != manifest.encoded():
                raise BadInput(str(path), "", f"is of another data set than {folder / FILE}", "they cannot be joined")
            found[folder] = before.model_copy(update={"shards": list(every.values())})
    return found


def merge_records(
    files: Annotated[list[Local], Parameter(help="Files of Records, folders of pages, or folders of products.")],
    *,
    recipe: OfSeveralPages = "",
    out: Annotated[Local, Parameter(help="File of Records to write, ending in .json.")],
) -> None:
    """Join Records, write them to `out`, and print the time of a query of each method on each machine.

    Raises
    ------
    BadInput
        If fewer than two files are given, one has no Records or no machine or holds several machines, or `out` is
        one of them, no name of a .json file, or in no folder.
    """
    from reports.machines import join, names_of
    from reports.record import read_machine, read_records, write_records

    if len(files) < 2:
        raise BadInput(_RECORDS, "files", [str(path) for path in files], "two files of Records or more are needed")
    sources = [records_file(path, recipe) for path in files]
    if out.suffix != ".json" or not out.parent.is_dir():
        raise BadInput(_RECORDS, "--out", str(out), "must be a file in a folder that exists, ending in .json")
    if out.resolve() in [file.resolve() for file in sources]:
        raise BadInput(_RECORDS, "--out", str(out), "is one of the files to join; another name is needed")
    machines = [read_machine(file) for file in sources]
    names = names_of(machines)
    joined = join(dict(zip(names, (read_records([file]) for file in sources), strict=True)))
    first = machines[0]
    packages = {
        name: version
        for name, version in first.packages.items()
        if all(machine.packages.get(name) == version for machine in machines)
    }
    together = first.model_copy(update={"cpu": "; ".join(names), "packages": packages})
    write_records(out, joined.records, together)
    console = Terminal()
    console.print(_times(joined.records, names))
    for index, name in enumerate(names):
        console.print(f"{_letter(index)}: {name}, {machines[index].date}", soft_wrap=True)
    said = f"{len(joined.records):,} Records of {len(names)} machines; {joined.shared:,} are alike and kept once"
    console.print(f"{out}: {said}", soft_wrap=True)
    if joined.unlike:
        a, b = joined.unlike[0]
        what = " ".join(filter(None, (a.metric, "of", a.method, a.setting, a.fabric or a.scene)))
        console.print(
            f"{len(joined.unlike):,} numbers differ and both are kept, such as {what}: {a.value:g} and {b.value:g}",
            soft_wrap=True,
        )


def _times(records: Sequence[Record], names: Sequence[str]) -> Table:
    """Show the time of a query on one thread: a row a method, a column a machine."""
    found: dict[tuple[str, str], dict[str, float]] = {}
    for record in records:
        if record.metric == "time" and record.threads in (0, 1):
            found.setdefault((record.method, record.setting), {})[record.provenance.machine] = record.value
    columns = [f"{_letter(index)}, ns a query" for index in range(len(names))]
    table = table_of("method", *columns, right=columns)
    for (method, setting), times in found.items():
        table.add_row(f"{method} {setting}".strip(), *(number(times.get(name, float("nan"))) for name in names))
    return table


def _letter(index: int) -> str:
    return chr(ord("A") + index) if index < 26 else str(index + 1)
