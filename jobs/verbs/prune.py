"""`twillight prune`: files in the output folder that none of some recipes needs, listed or removed.

Removed are products with their receipts, manifests, and what stopped tasks left. Files that no task made, such as crash
reports and the recipes of `twillight require`, are listed apart and kept.
"""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final, NamedTuple

from cyclopts import Parameter

from jobs.plan.dataset import DATASETS, DataSet
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.faults import is_leftover, own_files
from jobs.run.ledger import Ledger
from jobs.run.store import FOLDERS, LOCKS
from jobs.terminal import MOST_SENTENCES, print_lines, print_table, size
from jobs.verbs.parameters import NOTHING, OUT, Add, Out
from pipeline.storage import is_local, listing, remove_all
from weaves.errors import BadInput

_RECEIPT: Final = re.compile(r"ledger/([0-9a-f]{16})(\.failed)?\.json")


class _Content(NamedTuple):
    """Bytes that are stored under one name or several."""

    id: tuple[object, ...]
    names: int
    bytes: int


def prune(
    recipes: Annotated[list[str], Parameter(help="Recipes whose products are kept, by name or path.")],
    *,
    delete: Annotated[bool, Parameter(help="Remove what is listed.")] = False,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """List the files that no recipe needs, or remove them.

    BadInput if no recipe is named, one cannot be used, or the folder holds no products; WorkFailed if a run uses it.
    """
    ledger = Ledger(out)
    if not recipes:
        raise BadInput("prune", "recipes", [], "name every recipe whose products are to be kept")
    if not ledger.exists():
        raise BadInput(str(out), "", "holds no products", "--out must name a folder with products of a run")
    with ledger.store.held():
        files = _files(out)
        needed, made = _needed(recipes, add, out, files), _made(ledger, files)
        unneeded = sorted(made - needed)
        if unneeded:
            _print_sizes({path: files[path] for path in unneeded})
        if kept := sorted(files.keys() - made - needed - LOCKS):
            more = f" and {len(kept) - MOST_SENTENCES:,} more" if len(kept) > MOST_SENTENCES else ""
            print_lines(f"kept, because no task made them: {', '.join(kept[:MOST_SENTENCES])}{more}")
        if delete:
            _delete(unneeded, out)
    named = ", ".join(recipes)
    end = f"removed; {named} need the others" if delete else f"are not needed by {named}; --delete removes them"
    done = f"{len(unneeded):,} files {end}" if unneeded else f"nothing to remove: {named} need all products"
    print_lines(f"{out}: {done}")


def _files(out: Path) -> dict[str, _Content]:
    if not is_local(out):
        return {path: _Content((path,), 1, stored.bytes) for path, stored in listing(out).items()}
    files = {}
    for path in out.rglob("*"):
        if path.is_file() or path.is_symlink():
            status = path.lstat()
            content = _Content((status.st_dev, status.st_ino), status.st_nlink, status.st_size)
            files[str(path.relative_to(out))] = content
    return files


def _needed(recipes: Sequence[str], add: Sequence[str], out: Path, every: Iterable[str]) -> set[str]:
    """Return the paths of all files that recipes need, receipts and notes of failures too."""
    needed = set[str]()
    for name in recipes:
        recipe = load_recipe(name, add)
        tasks = plan(recipe)
        needed.update(own_files(recipe, tasks, out))
        ids = {task.id for task in tasks} | {part.id for member in recipe.together for part in DataSet(member).shards}
        needed.update(f"ledger/{id}{ending}" for id in ids for ending in (".json", ".failed.json"))
        # What a stopped training goes on from.
        folders = {task.folder for task in tasks if hasattr(task, "folder")}
        for path in map(Path, every):
            if str(path.parent) in folders and is_leftover(path.name) and not path.name.startswith(".tmp-"):
                needed.add(str(path))
    return needed


def _made(ledger: Ledger, every: Iterable[str]) -> set[str]:
    """Return those of some files that tasks made, as receipts, lists of files and names show."""
    from pipeline.shards.manifest import FILE, Manifest
    from reports.page.files import read_files

    places = {place for receipt in ledger.receipts([]) for place in ledger.places(receipt)}
    for path in [place for place in places if place.endswith("/files.json")]:
        folder = Path(path).parent
        with suppress(BadInput):
            places.update(str(folder / name) for name in read_files(ledger.out / folder))
    made, copied = set(), set()
    for path in every:
        leftover = Path(path).parts[0] in FOLDERS and is_leftover(Path(path).name)
        if path in places or _RECEIPT.fullmatch(path) or leftover:
            made.add(path)
        elif path.endswith(".parquet"):
            copied.add(Path(path).parent)
    for path in every:
        # A manifest goes with its shards: a copied data set, of which no receipt knows, stays whole.
        folder = Path(path).parent
        if Path(path).parts[0] == DATASETS and Path(path).name == FILE and folder not in copied:
            with suppress(BadInput):
                Manifest.load(ledger.out / folder)
                made.add(path)
    return made


def _print_sizes(files: Mapping[str, _Content]) -> None:
    """Print by folder the numbers of files, and the bytes that removing them frees."""
    folders: dict[str, list[_Content]] = {}
    for path, content in files.items():
        parts = Path(path).parts
        folders.setdefault("/".join(parts[:2]) if parts[0] == DATASETS else parts[0], []).append(content)
    rows = []
    for folder, contents in (*folders.items(), ("all", list(files.values()))):
        # A file with another name elsewhere frees none.
        freed = sum(content.bytes for content, count in Counter(contents).items() if count == content.names)
        rows.append((folder, f"{len(contents):,}", size(freed)))
    print_table(("folder", "files", "size"), rows)


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
