"""The page that `twillight view` writes: one file that works from a disk, without a network."""

from __future__ import annotations

import html
import json
from pathlib import Path
from typing import Final

from pipeline.atomic import atomic_write
from pipeline.shader.limits import MOST_CELLS
from reports.options import LEAST_TILE, MOST_TILE
from reports.viewer.content import content
from reports.viewer.generate import SHADERS
from weaves.errors import BadInput
from weaves.fabric import Fabric

SCRIPTS: Final = ("tables.js", "picture.js", "controls.js")

_HOME = Path(__file__).parent


def write_page(fabric: Fabric, path: Path, truth: int) -> str:
    """Write the viewer of a fabric, whole or not at all, and return a sentence on it.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    path : Path
        File to write, ending in ``.html``; its folder is made.
    truth : int
        Pixels along each side of tiles, pictures of the truth and other methods, from LEAST_TILE to MOST_TILE; 0: none.

    Raises
    ------
    BadInput
        If the path or the number cannot be used, or the repeat is too large for the shader.
    """
    if path.suffix != ".html":
        raise BadInput("view", "--out", str(path), "a path that ends in .html is needed")
    if truth and not LEAST_TILE <= truth <= MOST_TILE:
        raise BadInput("view", "--truth", truth, f"must be from {LEAST_TILE} to {MOST_TILE}, or 0 for none")
    picks, ends = fabric.weave.warp_over.shape
    if ends * picks > MOST_CELLS:
        allowed = f"the shader takes repeats of at most {MOST_CELLS:,} cells"
        raise BadInput("view", "", f"{fabric.name}: {ends} ends × {picks} picks", allowed)
    found = content(fabric, truth)
    page = whole_page(found)
    atomic_write(path, page.encode())
    return f"{path}: {len(found['tables'])} tables, {len(found['views'])} views, {len(page) / 1e6:.1f} MB"


def whole_page(found: dict[str, object]) -> str:
    """Return the page of a content."""
    parts = {
        "FABRIC": html.escape(str(found["fabric"]).replace("_", " ")),
        "STILL": str(found["still"]),
        "STYLE": _text("page.css"),
        "SHADER": SHADERS["cloth"].read_text(encoding="utf-8"),
        "SELVAGE": SHADERS["selvage"].read_text(encoding="utf-8"),
        # No content can end the element.
        "CONTENT": json.dumps({key: value for key, value in found.items() if key != "still"}).replace("<", "\\u003c"),
        "SCRIPT": "\n".join(_text(name) for name in SCRIPTS),
    }
    page = _text("page.html")
    for name, text in parts.items():
        page = page.replace("{{ " + name + " }}", text)
    return page


def _text(name: str) -> str:
    return (_HOME / name).read_text(encoding="utf-8")
