"""`twillight prune`: files in the output folder that none of some recipes needs, listed or removed.

Removed are products with their receipts, manifests, and what stopped tasks left. Files that no task made, such as crash
reports and the recipes of `twillight require`, are listed apart and kept.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Final

from cyclopts import Parameter
from rich.table import Table

from jobs.console import MOST_SENTENCES, size, table_of
from jobs.plan.dataset import DATASETS, DataSet
from jobs.plan.plan import plan
from jobs.plan.task import Stage
from jobs.recipe.load import load_recipe
from jobs.run.faults import is_leftover, own_files
from jobs.run.ledger import Ledger
from jobs.terminal import Terminal
from jobs.verbs.parameters import NOTHING, OUT, Add, Out
from pipeline.storage import is_local, listing, remove_all
from weaves.errors import BadInput

FOLDERS: Final[dict[Stage, str]] = {"generate": DATASETS, "train": "models", "bench": "records", "report": "report"}
"""Folder of the products of each stage."""

_RECEIPT: Final = re.compile(r"ledger/([0-9a-f]{16})(\.failed)?\.json")


def prune(
    recipes: Annotated[list[str], Parameter(help="Recipes whose products are kept, by name or path.")],
    *,
    delete: Annotated[bool, Parameter(help="Remove what is listed.")] = False,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """List the files that no recipe needs, or remove them.

    Raises
    ------
    BadInput
        If no recipe is named, one cannot be used, or the folder holds no products.
    WorkFailed
        If a run is at work in the folder.
    """
    ledger, console = Ledger(out), Terminal()
    if not recipes:
        raise BadInput("prune", "recipes", [], "name every recipe whose products are to be kept")
    if not ledger.exists():
        raise BadInput(str(out), "", "holds no products", "--out must name a folder with products of a run")
    with ledger.store.held():
        needed = _needed(recipes, out, add)
        stored = {} if is_local(out) else {path: one.bytes for path, one in listing(out).items()}
        files = (path for path in out.rglob("*") if path.is_file() or path.is_symlink()) if is_local(out) else ()
        every = set(stored) | {str(path.relative_to(out)) for path in files}
        made = _made(ledger, every)
        unneeded = sorted(made - needed)
        kept = sorted(every - made - needed - {"ledger/lock"})
        if unneeded:
            console.print(_table(unneeded, out, stored))
        if kept:
            names = ", ".join(kept[:MOST_SENTENCES])
            more = f" and {len(kept) - MOST_SENTENCES:,} more" if len(kept) > MOST_SENTENCES else ""
            console.print(f"kept, because no task made them: {names}{more}", soft_wrap=True)
        if delete:
            _delete(unneeded, out)
    named = ", ".join(recipes)
    if not unneeded:
        said = f"nothing to remove: {named} need all products"
    elif delete:
        said = f"{len(unneeded):,} files removed; {named} need the others"
    else:
        said = f"{len(unneeded):,} files are not needed by {named}; --delete removes them"
    console.print(f"{out}: {said}", soft_wrap=True)


def _needed(recipes: Sequence[str], out: Path, add: Sequence[str]) -> set[str]:
    """Return the paths of all files that recipes need, receipts and notes of failures too."""
    needed = set[str]()
    for name in recipes:
        recipe = load_recipe(name, add)
        tasks = plan(recipe)
        needed.update(own_files(recipe, tasks, out))
        ids = {task.id for task in tasks} | {part.id for one in recipe.together for part in DataSet(one).shards}
        needed.update(f"ledger/{id}{ending}" for id in ids for ending in (".json", ".failed.json"))
        # What a stopped training goes on from.
        folders = [task.folder for task in tasks if hasattr(task, "folder")] if is_local(out) else []
        needed.update(
            str(path.relative_to(out))
            for folder in folders
            for path in (out / folder).glob("*")
            if is_leftover(path.name) and not path.name.startswith(".tmp-")
        )
    return needed


def _made(ledger: Ledger, every: Iterable[str]) -> set[str]:
    """Return those of some files that tasks made, as receipts, lists of files and names show."""
    from pipeline.shards.manifest import FILE, Manifest
    from reports.page.files import read_files

    places = {place for receipt in ledger.receipts([]) for place in ledger.places(receipt)}
    for path in [place for place in places if place.endswith("/files.json")]:
        folder = Path(path).parent
        try:
            places.update(str(folder / name) for name in read_files(ledger.out / folder))
        except BadInput:
            continue
    made = set()
    for path in every:
        name, top = Path(path).name, Path(path).parts[0]
        ours = path in places or _RECEIPT.fullmatch(path) or (top in FOLDERS.values() and is_leftover(name))
        if not ours and top == DATASETS and name == FILE:
            try:
                ours = bool(Manifest.load((ledger.out / path).parent))
            except BadInput:
                ours = False
        if ours or (top == "ledger" and is_leftover(name)):
            made.add(path)
    return made


def _table(paths: Sequence[str], out: Path, stored: Mapping[str, int]) -> Table:
    """Show numbers and sizes of files by folder."""
    table = table_of("folder", "files", "size", right=("files", "size"))
    groups: dict[str, list[str]] = {}
    for path in paths:
        parts = Path(path).parts
        groups.setdefault("/".join(parts[:2]) if parts[0] == DATASETS else parts[0], []).append(path)
    for folder, members in groups.items():
        table.add_row(folder, f"{len(members):,}", size(_bytes(members, out, stored)))
    table.add_row("all", f"{len(paths):,}", size(_bytes(paths, out, stored)))
    return table


def _bytes(paths: Iterable[str], out: Path, stored: Mapping[str, int]) -> int:
    """Return the bytes that removing some files frees: a file with another name elsewhere frees none.

    `stored` has the sizes of files in object storage, where each file has one name.
    """
    if not is_local(out):
        return sum(stored[path] for path in paths)
    found: dict[tuple[int, int], list[int]] = {}
    for path in paths:
        status = (out / path).lstat()
        entry = found.setdefault((status.st_dev, status.st_ino), [0, status.st_nlink, status.st_size])
        entry[0] += 1
    return sum(bytes_ for names, links, bytes_ in found.values() if names == links)


def _delete(paths: Sequence[str], out: Path) -> None:
    """Remove products before their receipts, by which a stopped deletion finds them again; then empty folders."""
    ordered = sorted(paths, key=lambda path: path.startswith("ledger/"))
    if not is_local(out):
        remove_all(out, ordered)
        return
    for path in ordered:
        (out / path).unlink(missing_ok=True)
    folders = {parent for path in paths for parent in Path(path).parents if parent.parts}
    for folder in sorted(folders, key=lambda folder: -len(folder.parts)):
        if (out / folder).is_dir() and not any((out / folder).iterdir()):
            (out / folder).rmdir()
