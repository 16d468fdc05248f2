"""A cloth's yarns and the walls between them as a binary PLY.

Lengths are in yarn spacings: x along the weft, y along the warp, z up. Every vertex has the diffuse colour of its end
or pick as 8-bit sRGB, those of the walls `WALL`.
"""

from pathlib import Path
from typing import Final

import numpy as np
import trimesh

from pipeline.atomic import atomic_path
from reports.images.tiles import encoded
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.mesh import joined, repeat_mesh

WALL: Final = (32, 32, 32)
MOST_TRIANGLES: Final = 50_000_000  # more are refused: the file would have a gigabyte, and the work in memory ten


def write_mesh(fabric: Fabric, path: Path, vertices: int = 64, repeats: int = 1) -> str:
    """Write a cloth as one PLY file, whole or not at all, and return a sentence on it.

    Every yarn has `vertices` steps across it, and along it in every cell of the draft, >= 2; there are `repeats` copies
    of the repeat along x and along y, >= 1. BadInput if a number or the path cannot be used, or more than
    `MOST_TRIANGLES` would be needed.
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
        colours = [np.tile(np.array(WALL, np.uint8), (len(meshes.walls.vertices), 1))]
        for axis, (mesh, dyed) in enumerate(zip(meshes[:2], fabric.thread_colours(), strict=True)):
            # A vertex belongs to the thread of its triangles: it may lie on the border of two.
            thread = np.zeros(len(mesh.vertices), np.intp)
            thread[mesh.faces] = np.floor(mesh.vertices[mesh.faces, axis].mean(axis=1, keepdims=True))
            colours.insert(axis, encoded(dyed.diffuse)[thread % len(dyed.diffuse)])
        # Processing would merge or reorder vertices, and take the walls' edges from them.
        whole = trimesh.Trimesh(*joined(meshes), vertex_colors=np.concatenate(colours), process=False)
        temporary.write_bytes(trimesh.exchange.ply.export_ply(whole, encoding="binary"))
    of_weave, of_colours = np.array(fabric.weave.repeat), np.array(fabric.repeat)
    most = int((of_colours // of_weave).max())
    part = f", part of a pattern that repeats after {most} repeats of the weave" if repeats < most else ""
    return f"{path}: {len(whole.faces):,} triangles{part}; lengths in yarn spacings, z up"
