"""`twillight import`: the draft file of a weaving program becomes a fabric file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from jobs.terminal import Terminal
from pipeline.atomic import atomic_write
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
    found = fabric_of(file, yarns, own, str(draft), given)
    atomic_write(out, found.fabric.to_toml().encode())
    console = Terminal()
    program = f", written by {file.program}" if file.program else ""
    console.print(f"{out}: fabric {own} from the draft {file.title!r}{program}", soft_wrap=True)
    for heading, sentences in (("Read:", found.read), ("Assumed:", found.assumed)):
        console.print(heading)
        for sentence in sentences:
            console.print(f"- {sentence}", soft_wrap=True)
