"""The file that `twillight export --wif` writes: a fabric as a draft that weaving programs read."""

from __future__ import annotations

from pathlib import Path

from pipeline.atomic import atomic_write
from weaves.draft_files.write import wif_text
from weaves.errors import BadInput
from weaves.fabric import Fabric


def write_draft(fabric: Fabric, path: Path) -> str:
    """Write a fabric as a WIF file, whole or not at all, and return a sentence on its content.

    Raises
    ------
    BadInput
        If the path does not end in ``.wif``, or the fabric needs more ends or picks than a file may have.
    """
    if path.suffix != ".wif":
        raise BadInput("export", "--wif", str(path), "a path that ends in .wif is needed")
    text = wif_text(fabric)
    atomic_write(path, text.encode())
    content = "structure and colours" if fabric.yarns_per_cm is None else "structure, colours, spacing and thickness"
    left = "" if fabric.yarns_per_cm else "; no spacing and thickness, because the fabric has no yarns_per_cm"
    return f"{path}: {content}{left}; a draft file has no place for the optics of yarns"
