"""Which of Mitsuba's variants is used: scalar_rgb works everywhere, the LLVM one is many times as fast.

Mitsuba looks for LLVM itself (`DRJIT_LIBLLVM_PATH` names one). Versions before 16 end the process when a kernel is
compiled that they cannot, so another process tries the same kinds of kernel first.
"""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from typing import Any, Literal

_TRIAL = """
import drjit
import mitsuba
mitsuba.set_variant("llvm_ad_rgb")
assert drjit.detail.llvm_version() >= (16,)
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
    trial = subprocess.run([sys.executable, "-c", _TRIAL], capture_output=True, timeout=120, check=False)
    return trial.returncode == 0


def mitsuba(variant: Literal["auto", "scalar_rgb", "llvm_ad_rgb"] = "auto") -> Any:
    """Return the module Mitsuba with the variant set; Mitsuba knows one at a time, for the whole process."""
    import mitsuba as mi

    chosen = variant if variant != "auto" else "llvm_ad_rgb" if llvm_works() else "scalar_rgb"
    if mi.variant() != chosen:
        mi.set_variant(chosen)
    return mi
