"""The folder that `twillight export --shader` writes: source, tables, descriptor and golden vectors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from jobs.verbs.exchange.shader.constants import TEXTURE_WIDTH
from jobs.verbs.exchange.shader.descriptor import FILE, GOLDEN, descriptor, vectors
from jobs.verbs.exchange.shader.golden import golden
from jobs.verbs.exchange.shader.languages import SOURCE, compiler_for, made, refuse_unknown, translate
from jobs.verbs.exchange.shader.sides import tabulate_sides, wanted_kinds
from jobs.verbs.exchange.shader.tables import Tables, layout_slang, refuse_large, tables
from pipeline.analytic.soft_nodes.detail import DETAILS
from pipeline.atomic import atomic_folder
from reports.images.texture import png_bytes
from weaves.errors import BadInput
from weaves.fabric import Fabric

SOURCES: Final = (
    "soft_nodes.slang", "importance.slang", "evaluate.slang", "draw.slang", "buffers.slang", "arithmetic.slang",
    "horizons.slang", "query.slang", "colours.slang", "shade.slang", "fixed_nodes.slang", "placed_nodes.slang",
)  # fmt: skip
"""Files of the source; `layout.slang` is generated beside them."""

_HOME = Path(__file__).parent


def export_shader(fabric: Fabric, folder: Path, level: int, languages: Sequence[str], kinds: Sequence[str] = ()) -> str:
    """Write the soft nodes of a fabric for renderers, whole or not at all, and return a sentence on the folder.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    folder : Path
        Folder to write; it may hold an export of before, which it then replaces.
    level : int
        Level of detail k, one of DETAILS.
    languages : sequence of str
        Shading languages beside the source in Slang: keys of LANGUAGES, or ``"all"``.
    kinds : sequence of str
        Kinds of queries beside light and viewer in front of flat cloth: of KINDS, or ``"all"``.

    Raises
    ------
    BadInput
        If a language or kind is not known, slangc is needed and not there, the level is none, or the cloth too large.
    WorkFailed
        If slangc refuses the source.
    """
    refuse_unknown(languages)
    if level not in DETAILS:
        raise BadInput("export", "--level", level, f"must be one of {', '.join(map(str, DETAILS))}")
    known = wanted_kinds(kinds)
    wanted = made(languages)
    compiler = compiler_for(wanted) if wanted else None
    picks, ends = fabric.weave.warp_over.shape
    refuse_large(ends, picks)
    sides = tabulate_sides(fabric, level, known)
    found = tables(sides)
    with atomic_folder(folder, FILE) as here:
        source = here / SOURCE
        source.mkdir()
        (source / "layout.slang").write_text(layout_slang(found), encoding="utf-8")
        for name in SOURCES:
            (source / name).write_bytes((_HOME / name).read_bytes())
        files = translate(wanted, compiler, source, here) if compiler else {}
        _write_tables(found, here / "tables")
        (here / GOLDEN).write_text(vectors(golden(sides)).model_dump_json() + "\n", encoding="utf-8")
        names = [f"{SOURCE}/{name}" for name in ("layout.slang", *SOURCES)]
        said = descriptor(fabric, level, found, known, names, files)
        (here / FILE).write_text(said.model_dump_json(indent=1) + "\n", encoding="utf-8")
        size = sum(path.stat().st_size for path in here.rglob("*") if path.is_file())
    nodes, written = sides.front.evenly.size, ", ".join((SOURCE, *files, *sorted(known)))
    return f"{folder}: {written}; level {level}, {nodes} nodes, {size / 1e3:,.0f} kB"


def _write_tables(found: Tables, folder: Path) -> None:
    """Write the four buffers."""
    folder.mkdir()
    (folder / "integers.i32").write_bytes(found.integers.astype("<i4").tobytes())
    (folder / "numbers.f32").write_bytes(found.numbers.astype("<f4").tobytes())
    (folder / "nodes.f32").write_bytes(found.nodes.astype("<f4").tobytes())
    (folder / "nodes.f16").write_bytes(found.nodes.astype("<f2").tobytes())
    rows = np.pad(found.grid, (0, -found.grid.size % TEXTURE_WIDTH)).reshape(-1, TEXTURE_WIDTH)
    # The lowest row of a texture comes first in a file.
    (folder / "grid.png").write_bytes(png_bytes(rows[::-1] / 255.0, "share"))
