"""Mitsuba: which of its variants is used, and that it runs its own code only.

The variant scalar_rgb works everywhere; the LLVM one is many times as fast.

Mitsuba looks for LLVM itself (`DRJIT_LIBLLVM_PATH` names one). Versions up to 16 end the process when a kernel is
compiled that they cannot, so another process tries the same kinds of kernel first.

A plugin of Mitsuba is a library, ``plugins/<type>.so``, which it looks for in the current folder and beside a scene's
file before its own folder. Whoever writes a scene could so bring code. Here its own folder comes first, always, and a
scene's types must be plugins of that folder (`instantiate`).
"""

import re
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any, Final, Literal

from weaves.errors import BadInput

LLVM_MISSING: Final = (
    "Mitsuba finds no LLVM library of version 19 or newer, so it computes one ray at a time, which is slow: "
    "`apt install libllvm19` on Debian, or name the library in DRJIT_LIBLLVM_PATH"
)

_TRIAL = """
import drjit
import mitsuba
mitsuba.set_variant("llvm_ad_rgb")
scene = mitsuba.load_dict({
    "type": "scene",
    "ball": {"type": "sphere"},
    "board": {"type": "rectangle"},
    "camera": {"type": "perspective", "film": {"type": "hdrfilm", "width": 4, "height": 4}},
})
aovs = "a:position,b:uv,c:sh_normal,d:dp_du,e:duv_dx,f:shape_index"
assert len(mitsuba.render(scene, integrator=mitsuba.load_dict({"type": "aov", "aovs": aovs}), spp=1).array) > 0
origin = mitsuba.Point3f(mitsuba.Float([0, 3]), 0, 4)
assert list(scene.ray_test(mitsuba.Ray3f(origin, mitsuba.Vector3f(0, 0, -1)))) == [True, False]
"""


@cache
def llvm_works() -> bool:
    """Return whether a fresh process can render and trace rays with Mitsuba's LLVM variant."""
    # In a folder without code of others, and without the current one among those that Python imports from (-P).
    command = [sys.executable, "-P", "-c", _TRIAL]
    trial = subprocess.run(command, capture_output=True, timeout=120, check=False, cwd=sys.prefix)
    return trial.returncode == 0


def mitsuba(variant: Literal["auto", "scalar_rgb", "llvm_ad_rgb"] = "auto") -> Any:
    """Return the module Mitsuba with the variant set; Mitsuba knows one at a time, for the whole process."""
    import mitsuba as mi

    chosen = variant if variant != "auto" else "llvm_ad_rgb" if llvm_works() else "scalar_rgb"
    if mi.variant() != chosen:
        mi.set_variant(chosen)
    _resolve(mi)
    return mi


def instantiate(mi: Any, path: Path, where: str) -> Any:
    """Load a scene from a file of Mitsuba, without merging shapes or BSDFs that look alike to it.

    BadInput if a type is no plugin of Mitsuba itself; Mitsuba's RuntimeError if the file is no scene that loads.
    """
    config = mi.parser.ParserConfig(mi.variant())
    config.merge_equivalent = config.merge_meshes = False
    state = mi.parser.parse_file(config, str(path))
    known = {"scene", *(file.stem for file in (_home(mi) / "plugins").iterdir())}
    for node in state.nodes:
        name = node.props.plugin_name()
        if name not in known or not re.fullmatch(r"[A-Za-z0-9_]+", name):
            raise BadInput(where, "type", name, "must be a plugin of Mitsuba itself, such as diffuse")
    try:
        mi.parser.transform_all(config, state)
        _resolve(mi, path.parent)
        return mi.parser.instantiate(config, state)
    finally:
        _resolve(mi)


def _home(mi: Any) -> Path:
    return Path(mi.__file__).parent


def _resolve(mi: Any, *folders: Path) -> None:
    """Let Mitsuba look for files in its own folder first, then in these, and nowhere else."""
    resolver = mi.FileResolver()
    resolver.clear()
    for folder in (_home(mi), *folders):
        resolver.append(str(folder.resolve()))
    mi.set_file_resolver(resolver)
