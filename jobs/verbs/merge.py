"""`twillight merge`: two folders of products become one, such as parts of a data set made on two machines.

Shards, models and Records are compared with their receipts and linked, or copied where there are no links. Pages are
left out: the next run writes them from what is there then.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from jobs.plan.dataset import DATASETS
from jobs.run.ledger import Ledger
from jobs.run.receipt import Product, Receipt
from jobs.run.store import LEDGER
from jobs.terminal import MOST_SENTENCES, print_lines
from jobs.verbs.parameters import Local
from pipeline.atomic import link
from pipeline.shards.manifest import FILE, Manifest
from weaves.errors import BadInput


class MergedTask(NamedTuple):
    """A finished task in one folder."""

    ledger: Ledger
    receipt: Receipt
    places: list[str]  # paths of its sound products, relative to the folder


def merge(
    a: Annotated[Local, Parameter(help="Folder of products.")],
    b: Annotated[Local, Parameter(help="Another one, for example of another machine.")],
    *,
    out: Annotated[Local, Parameter(help="Folder of all products; created if need be.")],
) -> int:
    """Join two folders of products in `out`, which may hold products itself; return the exit code.

    BadInput if a folder holds no products, two hold other bytes of the same task, or `out` cannot be written;
    WorkFailed if a run is at work in `out`.
    """
    for source in (a, b):
        if not (source / "ledger").is_dir():
            raise BadInput(str(source), "", "holds no products", "the output folder of a run is needed")
    target = Ledger(out)
    with target.store.held():
        others = [Ledger(source) for source in (a, b) if source.resolve() != out.resolve()]
        chosen: dict[str, MergedTask] = {}
        damaged: dict[str, str] = {}
        for part in (part for ledger in (target, *others) for part in _parts(ledger)):
            receipt = part.receipt
            if {Path(place).name for place in part.places} != receipt.files.keys():
                damaged[receipt.task] = f"{part.ledger.out}: {receipt.stage} {receipt.title}"
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
    sentences = [f"{task}: a product is missing or damaged; it is left out" for task in left]
    print_lines(*sentences[:MOST_SENTENCES], stderr=True)
    if len(left) > MOST_SENTENCES:
        print_lines(f"and {len(left) - MOST_SENTENCES:,} more", stderr=True)
    counts = Counter(str(part.ledger.out) for part in chosen.values())
    origins = ", ".join(f"{counts[str(ledger.out)]:,} from {ledger.out}" for ledger in others)
    print_lines(f"{out}: {len(chosen):,} finished tasks, {origins}; `twillight run` goes on")
    return BadInput.exit_code if left else 0


def _parts(ledger: Ledger) -> Iterator[MergedTask]:
    """Yield the finished tasks of a folder but its pages, each with the products whose bytes are as they were made."""
    for receipt in ledger.receipts([]):
        if receipt.stage != "report":
            products = {place: Product.of(ledger.out / place) for place in ledger.places(receipt)}
            sound = [place for place, product in products.items() if product == receipt.files[Path(place).name]]
            yield MergedTask(ledger, receipt, sound)


def _refuse_conflict(first: MergedTask, second: MergedTask) -> None:
    """Refuse two products of one task with unlike bytes; the machine and the date beside Records do not count."""
    files, others = (
        {name: product for name, product in part.receipt.files.items() if not name.endswith(".machine.json")}
        for part in (first, second)
    )
    if files != others:
        name = next(name for name in sorted(files) if files[name] != others.get(name))
        task = f"{first.receipt.stage} {first.receipt.title}"
        allowed = f"delete ledger/{first.receipt.task}.json in the folder whose product is not wanted"
        where = f"{first.ledger.out} and {second.ledger.out}"
        raise BadInput(where, "", f"{name} of {task} has other bytes in each", allowed)


def _manifests(ledgers: Sequence[Ledger], out: Path) -> dict[Path, Manifest]:
    """Return by folder in `out` the manifests of all data sets, each with the shards of all folders."""
    manifests: dict[Path, Manifest] = {}
    for ledger in ledgers:
        for path in sorted(ledger.out.glob(f"{DATASETS}/*/{FILE}")):
            manifest, folder = Manifest.load(path.parent), out / path.parent.relative_to(ledger.out)
            before = manifests.setdefault(folder, manifest)
            shards = {shard.file: shard for shard in (*before.shards, *manifest.shards)}
            if before.model_copy(update={"shards": manifest.shards}).encoded() != manifest.encoded():
                raise BadInput(str(path), "", f"is of another data set than {folder / FILE}", "they cannot be joined")
            manifests[folder] = before.model_copy(update={"shards": list(shards.values())})
    return manifests
