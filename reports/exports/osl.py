"""A shader in the Open Shading Language: the yarns of a fabric as Blender's Cycles and other ray tracers read them.

The file is `cloth.osl` with the tables of the fabric as parameters. One unit of its texture coordinates is as many
yarns as maps of the fabric show, so that both fit one mesh.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.atomic import atomic_write
from pipeline.materials.lobes import reflectance
from pipeline.materials.planes import LARGEST_MAP, SAMPLES_PER_YARN, best_layout, lowest_height, material_colours
from pipeline.truth.geometry.heightfield import ALPHA, BETA, BLEND, COS_TWIST, RADIUS, SIN_TWIST, height_field
from pipeline.truth.geometry.pieces import reference_plane
from weaves.fabric import Fabric
from weaves.surface import surface_maps

_YARN_COLUMNS: Final = [RADIUS, SIN_TWIST, COS_TWIST, ALPHA, BETA, BLEND]


def write_osl(fabric: Fabric, path: Path) -> str:
    """Write the shader of a fabric and return a sentence on it."""
    field, shown, share = height_field(fabric), best_layout(fabric, LARGEST_MAP), reflectance(fabric)
    numbers = {"ends": field.top.shape[1], "Ends": float(shown.ends), "Picks": float(shown.picks)}
    numbers |= {"highest": field.highest, "lowest": lowest_height(fabric), "plane": reference_plane(field)}
    # Floats that never change side are endless.
    tables = {"top": field.top, "floats": np.minimum(field.floats, 1e9), "yarns": field.yarn[:, _YARN_COLUMNS]}
    tables = {name: table.ravel() for name, table in tables.items()}
    seen = surface_maps(fabric, SAMPLES_PER_YARN)
    families = zip((fabric.warp, fabric.weft), ("end", "pick"), material_colours(fabric, share), strict=True)
    for family, (yarn, thread, colours) in enumerate(families):
        # Lobes of tilted normals lose what comes from below the cloth.
        kept = 1.0 - yarn.blend * (0.5 - 0.5 * seen.normal[seen.yarn == family, 2].mean())
        for name, rows in zip(("diffuse", "specular", "through"), colours, strict=True):
            # At least two rows: Blender takes an array of one for a single number.
            tables[f"{thread}_{name}"] = np.resize(np.minimum(rows / kept, 1.0), (max(2, len(rows)), 3))
    parameters = "".join(f"    {_parameter(name, np.array(value))},\n" for name, value in (numbers | tables).items())
    source = Path(__file__).with_name("cloth.osl").read_text(encoding="utf-8")
    atomic_write(path, source.replace("    // FABRIC\n", parameters).encode())
    return f"{path}: one unit of UV is {shown.ends} ends × {shown.picks} picks; both sides show the face"


def _parameter(name: str, value: npt.NDArray[Any]) -> str:
    """Return a parameter with its default: a number, or an array of numbers or of colours (n, 3)."""
    kind = "color" if value.ndim == 2 else "int" if value.dtype.kind == "i" else "float"
    texts = [f"color{tuple(row)}" if value.ndim == 2 else f"{row:.9g}" for row in np.atleast_1d(value).tolist()]
    return f"{kind} {name}[{len(texts)}] = {{{', '.join(texts)}}}" if value.ndim else f"{kind} {name} = {texts[0]}"
