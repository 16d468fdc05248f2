"""A cloth's yarns and the walls between them as a binary PLY.

Lengths are in yarn spacings: x along the weft, y along the warp, z up. Every vertex has the diffuse colour of its yarn
as 8-bit sRGB, those of the walls `WALL`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import trimesh

from pipeline.atomic import atomic_path
from reports.images.tiles import hex_colour
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.mesh import repeat_mesh

WALL: Final = "#202020"
MOST_TRIANGLES: Final = 50_000_000
"""More are refused: the file would have a gigabyte, and the work in memory ten."""


def write_mesh(fabric: Fabric, path: Path, vertices: int = 64, repeats: int = 1) -> str:
    """Write a cloth as one PLY file, whole or not at all, and return a sentence on it.

    Every yarn has `vertices` steps across it, and along it in every cell of the draft, >= 2; there are `repeats`
    copies of the repeat along x and along y, >= 1.

    Raises
    ------
    BadInput
        If a number or the path cannot be used, or more than `MOST_TRIANGLES` would be needed.
    """
    for key, value, least in (("vertices", vertices, 2), ("repeats", repeats, 1)):
        if value < least:
            raise BadInput("export", key, value, f"must be at least {least}")
    # The yarns alone: two triangles a step across and along, in every cell.
    needed = 2 * vertices**2 * fabric.weave.warp_over.size * repeats**2
    if needed > MOST_TRIANGLES:
        allowed = f"needs {needed:,} triangles; with fewer vertices or repeats, at most {MOST_TRIANGLES:,}"
        raise BadInput("export", "vertices", vertices, allowed)
    with atomic_path(path) as temporary:
        meshes = repeat_mesh(fabric, vertices, (repeats, repeats))
        colours = [hex_colour(fabric.warp.diffuse_rgb), hex_colour(fabric.weft.diffuse_rgb), WALL]
        start = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        whole = trimesh.Trimesh(
            vertices=np.concatenate([mesh.vertices for mesh in meshes]),
            faces=np.concatenate([mesh.faces + first for mesh, first in zip(meshes, start[:-1], strict=True)]),
            vertex_colors=np.repeat([[*bytes.fromhex(c[1:]), 255] for c in colours], np.diff(start), axis=0),
            process=False,  # merging or reordering vertices would take the walls' edges from them
        )
        temporary.write_bytes(trimesh.exchange.ply.export_ply(whole, encoding="binary"))
    return f"{path}: {len(whole.faces):,} triangles; lengths in yarn spacings, z up"
