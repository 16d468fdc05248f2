"""`twillight merge`: two folders of products become one, such as parts of a data set made on two machines.

Shards, models and Records are compared with their receipts and linked, or copied where there are no links. Pages are
left out: the next run writes them from what is there then.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from jobs.console import MOST_SENTENCES, print_line
from jobs.plan.dataset import DATASETS
from jobs.run.ledger import Ledger
from jobs.run.receipt import Product, Receipt
from jobs.terminal import Terminal
from pipeline.atomic import link
from pipeline.fingerprint import file_sha256
from weaves.errors import BadInput

if TYPE_CHECKING:
    from pipeline.shards.manifest import Manifest


class Part(NamedTuple):
    """A finished task in one folder."""

    ledger: Ledger
    receipt: Receipt
    places: list[str]
    """Paths of its sound products, relative to the folder."""


def merge(sources: Sequence[Path], out: Path) -> int:
    """Join folders of products in `out`, which may hold products itself; return the exit code.

    Raises
    ------
    BadInput
        If a folder holds no products, two hold other bytes of the same task, or `out` cannot be written.
    WorkFailed
        If a run is at work in `out`.
    """
    for source in sources:
        if not (source / "ledger").is_dir():
            raise BadInput(str(source), "", "holds no products", "the output folder of a run is needed")
    with Ledger(out).held():
        target = Ledger(out)
        others = [Ledger(source) for source in sources if source.resolve() != out.resolve()]
        chosen: dict[str, Part] = {}
        damaged: dict[str, str] = {}
        for ledger in (target, *others):
            for receipt in ledger.receipts([]):
                if receipt.stage == "report":
                    continue
                part = Part(ledger, receipt, list(_sound(ledger, receipt)))
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
                target.take(part.receipt)
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


def _refuse_conflict(first: Part, second: Part) -> None:
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
