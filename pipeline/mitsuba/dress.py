"""Scenes of `pipeline.scenes` for Mitsuba's integrators: shapes wear the BSDF `twillight`."""

from __future__ import annotations

from typing import Any

from pipeline.mitsuba import bsdf
from pipeline.mitsuba.register import register
from pipeline.models.patch_bsdf import USUAL
from pipeline.scenes.loading import Loaded
from pipeline.scenes.scene import PREFIX


def dress(loaded: Loaded, method: str = USUAL) -> Any:
    """Let the shapes of a loaded scene wear their cloth as a BSDF, and return Mitsuba's scene.

    Parameters
    ----------
    loaded : Loaded
        The scene; it is changed.
    method : str
        The method that evaluates the cloth (`pipeline.models.named`).
    """
    mi = register()
    worn = {}
    for key, (cloth, fabric) in loaded.cloths.items():
        properties = {"fabric": cloth.fabric or fabric.name, "yarns": cloth.yarns[0], "yarns_v": cloth.yarns[1]}
        worn[key] = mi.load_dict({"type": bsdf.NAME, "method": method, "turn": cloth.turn, **properties})
    for shape in loaded.world.shapes():
        name = str(shape.bsdf().id()) if shape.bsdf() is not None else ""
        if name.startswith(PREFIX):
            shape.set_bsdf(worn[name.removeprefix(PREFIX)])
    return loaded.world
