"""`twillight publish`: a data set as a self-contained folder that others can read and cite.

The folder is written under a temporary name beside its place and renamed when it is whole. A run that was stopped is
continued by the same command, which keeps finished files of rows. The same data set gives the same bytes.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Final

import tomli_w
from cyclopts import Parameter
from filelock import FileLock, Timeout

from jobs.plan.dataset import DataSet
from jobs.recipe.load import load_recipe
from jobs.terminal import print_lines, size, tracked
from jobs.verbs.parameters import Local
from jobs.verbs.publish.card import LOADER, card, citation_file, croissant, licence_id
from jobs.verbs.publish.contents import POPULATIONS, About, Citation, PublishedPart, own_shards, parts_of
from pipeline.atomic import atomic_write
from pipeline.fingerprint import file_sha256, fingerprint
from pipeline.shards.check import check_shard
from pipeline.shards.generate import ShardTask
from pipeline.shards.manifest import FILE as MANIFEST
from pipeline.shards.manifest import Manifest, Published, PublishedFile
from pipeline.shards.pieces import join_shards
from pipeline.shards.store import read_about
from weaves.errors import BadInput, WorkFailed, brief

_DEFAULT_TITLE: Final = "ground truth of the appearance of woven cloth"
_LOCK: Final = ".lock"
_UNCITED: Final = Citation()
_RECIPE: Final = "recipe.toml"
_MODELS: Final = ((), ("neumip",), ("curved",), ("point_sampled",))
"""Models whose presence decides which splits a recipe has: those of one material need rows of unseen fabrics."""


def publish(
    dataset: Annotated[Local, Parameter(help="Folder of a data set, out/datasets/NAME-FINGERPRINT.")],
    *,
    to: Annotated[Local | None, Parameter(help="Folder to write; empty or not there.")] = None,
    licence: Annotated[str | None, Parameter(help="SPDX identifier of the data's licence, such as CC-BY-4.0.")] = None,
    citation: Annotated[Citation, Parameter(name="*")] = _UNCITED,
) -> None:
    """Write a data set as a folder for others.

    BadInput if the licence is missing or unknown, a value of the citation has not its form, the folder to write is not
    empty, or the data set is not whole; WorkFailed if another process writes the same folder.
    """
    identifier = licence_id(licence)
    citation.refuse_wrong()
    target = _free(to, dataset)
    manifest = Manifest.load(dataset)
    _refuse_unfinished(dataset, manifest)
    recipe, first = _recipe_files(manifest, dataset), own_shards(manifest)[0]
    truth = int(read_about(dataset / first.file).get("task", {}).get("version", 0))
    citation = replace(citation, title=citation.title or f"Twillight {manifest.name}: {_DEFAULT_TITLE}")
    about = About(manifest, parts_of(manifest), identifier, citation, truth)
    staging = target.with_name(f".tmp-{target.name}")
    left = {path.name for path in staging.iterdir()} if staging.is_dir() else set()
    if left and not left & {_LOCK, MANIFEST}:
        raise BadInput(str(staging), "", "is in the way", "it is not of this command; move it, or name another --to")
    try:
        staging.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BadInput(str(target.parent), "", error.strerror, "a folder that can be written is needed") from error
    lock = FileLock(staging / _LOCK)
    try:
        with lock.acquire(timeout=0):
            files = _write(about, recipe, dataset, staging)
            _remove_others(staging, {*files, MANIFEST, _LOCK})
            (staging / _LOCK).unlink()
            if target.exists():
                target.rmdir()
            staging.rename(target)
    except Timeout as error:
        raise WorkFailed(f"{target}: another process is writing it") from error
    written = sum(path.stat().st_size for path in target.rglob("*") if path.is_file())
    rows = f"{about.rows:,} rows in {len(about.parts)} Parquet files"
    print_lines(f"{target}: {rows}, {size(written)}, licence {identifier}")


def _free(to: Path | None, folder: Path) -> Path:
    if to is None:
        raise BadInput("publish", "", "--to is missing", "the folder to write is needed")
    if to.is_dir():
        if any(to.iterdir()):
            raise BadInput("publish", "--to", str(to), "is not empty; name another folder, or empty it")
    elif to.exists() or to.is_symlink():
        raise BadInput("publish", "--to", str(to), "is no folder; name another place")
    if to.resolve().is_relative_to(folder.resolve()):
        raise BadInput("publish", "--to", str(to), "is inside the data set; name another place")
    return to.resolve()


def _refuse_unfinished(folder: Path, manifest: Manifest) -> None:
    """Refuse a data set with missing or damaged shards by the first fault, and the number of the others."""
    shards = own_shards(manifest)
    listed = fingerprint(sorted(Path(shard.file).stem.removeprefix("part-") for shard in shards))
    if not shards or listed != manifest.fingerprint:
        allowed = f"run `twillight generate {manifest.name}` to its end"
        raise BadInput(str(folder), "", f"is not whole: {len(shards):,} of its shards are finished, not all", allowed)
    faults = [fault for shard in tracked(shards, "checking") for fault in check_shard(folder, shard, manifest)]
    if faults:
        more = f" ({len(faults) - 1:,} more faults)" if len(faults) > 1 else ""
        reason = faults[0].removeprefix(f"{folder}/")
        raise BadInput(str(folder), "", "is not whole", f"{reason}{more}")


def _write(about: About, texts: dict[str, str], folder: Path, staging: Path) -> list[str]:
    """Write all files, `texts` among them, and return their paths within the folder; the manifest is the last one."""
    texts = {
        **texts,
        "README.md": card(about),
        "croissant.json": croissant(about),
        "CITATION.cff": citation_file(about),
        "load.py": LOADER.read_text(encoding="utf-8"),
    }
    for name, text in texts.items():
        atomic_write(staging / name, text.encode())
    for part in tracked(about.parts, "joining"):
        join_shards(staging / part.file, [folder / shard.file for shard in part.shards], _facts(about, part))
    files = [*texts, *(part.file for part in about.parts)]
    atomic_write(staging / MANIFEST, _listing(about, staging, files))
    return files


def _facts(about: About, part: PublishedPart) -> dict[str, Any]:
    """Return the metadata of a file of rows, from which it is known again."""
    return {
        "schema_version": about.manifest.schema_version,
        "truth_version": about.truth_version,
        "dataset": about.manifest.fingerprint,
        "role": part.role,
        "split": part.split,
        "fabrics": {name: about.manifest.fabrics[name].model_dump(mode="json") for name in part.fabrics},
        "options": about.manifest.about,
        "shards": [shard.sha256 for shard in part.shards],
    }


def _listing(about: About, staging: Path, files: Sequence[str]) -> bytes:
    """Return the manifest: every other file with its size and hash, and what is in the files of rows."""
    listed, parts = [], {part.file: part for part in about.parts}
    for file in sorted(files):
        path, own = staging / file, {}
        if part := parts.get(file):
            rows = {name: sum(shard.rows for shard in part.shards if shard.fabric == name) for name in part.fabrics}
            own = {"role": part.role, "split": part.split, "rows": rows}
        listed.append(PublishedFile(file=file, bytes=path.stat().st_size, sha256=file_sha256(path), **own))
    return Published(
        name=about.manifest.name,
        version=about.version,
        fingerprint=about.manifest.fingerprint,
        schema_version=about.manifest.schema_version,
        truth_version=about.truth_version,
        licence=about.licence,
        rows=about.rows,
        roles=about.manifest.roles,
        fabrics=about.manifest.fabrics,
        options=about.manifest.about,
        files=listed,
    ).encoded()


def _remove_others(staging: Path, wanted: set[str]) -> None:
    """Remove what an earlier run of another data set left."""
    for path in sorted(staging.rglob("*"), reverse=True):
        if path.is_dir():
            if not any(path.iterdir()):
                path.rmdir()
        elif str(path.relative_to(staging)) not in wanted:
            path.unlink()


def _recipe_files(manifest: Manifest, folder: Path) -> dict[str, str]:
    """Return the recipe that generates a data set and the files of its fabrics, by their paths.

    `folder` is that of the data set, for messages. BadInput if no recipe of this version has its rows.
    """
    fabrics = _fabric_files(manifest)
    present = {(shard.fabric, shard.split, shard.start, shard.rows) for shard in own_shards(manifest)}
    with TemporaryDirectory(prefix="twillight-") as name:
        for path, text in fabrics.items():
            atomic_write(Path(name) / path, text.encode(), durable=False)
        for models in _MODELS:
            text = _recipe(manifest, models)
            atomic_write(Path(name) / _RECIPE, text.encode(), durable=False)
            try:
                planned = DataSet(load_recipe(Path(name) / _RECIPE)).shards
            except BadInput as error:
                if models:  # which do not know these queries
                    continue
                key = f"{error.key} = {brief(error.value)}" if error.key else "its fabrics"
                raise BadInput(str(folder), "", f"is of another version ({key})", "generate it again") from error
            parts = [part.shard for part in planned if isinstance(part.shard, ShardTask)]
            if {(part.fabric.name, part.split, part.start, part.rows) for part in parts} == present:
                return {**fabrics, _RECIPE: text}
    raise BadInput(str(folder), "", "its rows are not those of a recipe of this version", "generate it again")


def _fabric_files(manifest: Manifest) -> dict[str, str]:
    files = {f"fabrics/{name}.toml": manifest.fabrics[name].to_toml() for name in manifest.names("seen", "unseen")}
    for role in POPULATIONS:
        if population := manifest.names(role):
            tables = {name: manifest.fabrics[name].model_dump(mode="json", exclude_none=True) for name in population}
            files[f"{role}.toml"] = tomli_w.dumps(tables)
    return files


def _recipe(manifest: Manifest, models: Sequence[str]) -> str:
    """Return a recipe for the data set, with models that decide which splits it has."""
    named = {role: [f"fabrics/{name}.toml" for name in manifest.names(role)] for role in ("seen", "unseen")}
    recipe = {
        "name": manifest.name,
        "about": "Generates the rows of this data set.",
        "dataset": _without_none(manifest.about) | named,
        "models": [{"model": model} for model in models],
    }
    return tomli_w.dumps(recipe)


def _without_none(value: Any) -> Any:
    """Return tables without the keys that have no value: TOML has none."""
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value
