"""`twillight import` makes a fabric of a draft file; `export` and `view` write a fabric for other programs."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jobs.terminal import Terminal
from pipeline.atomic import atomic_write
from reports.exports.export import export
from weaves.draft_files.read import read_draft
from weaves.draft_files.to_fabric import fabric_of
from weaves.errors import BadInput
from weaves.fabric import load_fabric


def import_draft(draft: Path, out: Path, like: str, name: str | None, given: Mapping[str, Mapping[str, float]]) -> None:
    """Write the fabric of a draft file, and print what was read and what is assumed.

    Parameters
    ----------
    draft : Path
        The draft file.
    out : Path
        Fabric file to write, ending in ``.toml``; whole or not at all.
    like : str
        Fabric whose yarns give what the draft does not state.
    name : str or None
        Name of the fabric; the default is that of the draft file, without letters that no name has.
    given : mapping of mappings
        Numbers of the yarns ``"warp"`` and ``"weft"`` in place of those of `like`.

    Raises
    ------
    BadInput
        If the draft, a name or a number cannot be used.
    """
    if out.suffix != ".toml":
        raise BadInput("import", "--out", str(out), "a path that ends in .toml is needed")
    # First: reading the colours of a fabric loads much, which a damaged draft need not wait for.
    file = read_draft(draft)
    yarns = load_fabric(like)
    own = name if name is not None else re.sub(r"[^A-Za-z0-9_-]+", "_", draft.stem).strip("_")[:60] or "draft"
    drafted = fabric_of(file, yarns, own, str(draft), given)
    atomic_write(out, drafted.fabric.to_toml().encode())
    console = Terminal()
    program = f", written by {file.program}" if file.program else ""
    console.print(f"{out}: fabric {own} from the draft {file.title!r}{program}", soft_wrap=True)
    for heading, sentences in (("Read:", drafted.read), ("Assumed:", drafted.assumed)):
        console.print(heading)
        for sentence in sentences:
            console.print(f"- {sentence}", soft_wrap=True)


def export_fabric(name: str, paths: Mapping[str, Path | None], options: Mapping[str, Any]) -> None:
    """Write a fabric for other programs, and print what was written.

    Parameters
    ----------
    name : str
        The fabric.
    paths : mapping
        File or folder of each kind of export; one is given.
    options : mapping
        Options of the exports; those that are None or empty are left out.

    Raises
    ------
    BadInput
        If not one path is given, or as `reports.exports.export.export`.
    """
    flags = [f"--{kind}" for kind in paths]
    chosen = {kind: path for kind, path in paths.items() if path is not None}
    if len(chosen) != 1:
        allowed = f"one of {', '.join(flags[:-1])} and {flags[-1]} is needed"
        raise BadInput("export", "", " and ".join(f"--{kind}" for kind in chosen) or "nothing", allowed)
    ((kind, path),) = chosen.items()
    given = {key: value for key, value in options.items() if value not in (None, [])}
    _write("export", name, kind, path, given)


def view(name: str, out: Path, truth: int) -> None:
    """Write the page of a fabric, with tiles of `truth` pixels along each side, and print what was written."""
    with Terminal().status("tables and tiles"):
        _write("view", name, "viewer", out, {"truth": truth}, viewer="out")


def _write(verb: str, name: str, kind: str, path: Path, options: Mapping[str, Any], **flags: str) -> None:
    """Export a fabric and print what was written; in messages, options have the names that they have in the verb."""
    try:
        sentence = export(load_fabric(name), kind, path, **options)
    except BadInput as error:
        if error.where != "export":
            raise
        key = error.key and f"--{flags.get(error.key, error.key)}"
        raise BadInput(verb, key, error.value, error.allowed) from error
    Terminal().print(sentence, soft_wrap=True)
