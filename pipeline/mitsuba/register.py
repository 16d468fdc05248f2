"""The plugins entered into Mitsuba, for the variant that is set and each that is set later; scenes that wear them."""

import warnings
from collections.abc import Callable
from functools import wraps
from typing import Any, NoReturn

import mitsuba as mi

from pipeline.mitsuba.bsdf import BSDF, WITHOUT_CLOTH, bsdf_class, wears_cloth
from pipeline.mitsuba.integrator import INTEGRATOR, integrator_class
from pipeline.models.patch_bsdf import USUAL_METHOD
from pipeline.scenes.loading import Loaded
from pipeline.scenes.scene import PREFIX
from pipeline.scenes.variant import LLVM_MISSING, llvm_works
from weaves.errors import BadInput

_registered: set[str] = set()


def register() -> Any:
    """Enter the plugins into Mitsuba and return the module; without a variant, set the best; BadInput if not RGB."""
    if mi.variant() is None:
        mi.set_variant(best_variant())
    if not _rgb(str(mi.variant())):
        _refuse_colours()
    if not _registered:
        mi.detail.add_variant_callback(lambda old, new: _enter())
    _enter()
    return mi


def dress(loaded: Loaded, method: str = USUAL_METHOD) -> Any:
    """Let the shapes of a loaded scene, which is changed, wear their cloth as a BSDF; return Mitsuba's scene."""
    register()
    worn = {}
    alike: dict[str, Any] = {"type": BSDF, "method": method, "bounces": loaded.options.bounces}
    for key, (cloth, fabric) in loaded.cloths.items():
        layout = {"yarns": cloth.yarns[0], "yarns_v": cloth.yarns[1], "turn": cloth.turn}
        worn[key] = mi.load_dict({**alike, "fabric": cloth.fabric or fabric.name, **layout})
    for shape in loaded.world.shapes():
        name = str(shape.bsdf().id()) if shape.bsdf() is not None else ""
        if name.startswith(PREFIX):
            shape.set_bsdf(worn[name.removeprefix(PREFIX)])
    return loaded.world


def best_variant() -> str:
    """Return llvm_ad_rgb where it works, which a fresh process tries first; else scalar_rgb, with a warning."""
    if llvm_works():
        return "llvm_ad_rgb"
    warnings.warn(LLVM_MISSING, stacklevel=4)
    return "scalar_rgb"


def _rgb(variant: str) -> bool:
    """Return whether colours are three numbers, without polarisation."""
    return variant.removesuffix("_double").endswith("_rgb")


def _enter() -> None:
    """Enter the plugins for the variant that is set, once."""
    variant = str(mi.variant())
    if not hasattr(mi.render, "__wrapped__"):
        mi.render = _guarded(mi.render)
    if variant in _registered:
        return
    _registered.add(variant)
    mi.register_bsdf(BSDF, bsdf_class() if _rgb(variant) else _refuse_colours)
    mi.register_integrator(INTEGRATOR, integrator_class() if _rgb(variant) else _refuse_colours)


def _refuse_colours(props: Any = None) -> NoReturn:
    raise BadInput("mitsuba", "variant", mi.variant(), "must have RGB colours, such as llvm_ad_rgb or scalar_rgb")


def _guarded(render: Callable[..., Any]) -> Callable[..., Any]:
    """Return `mi.render` that ends in our sentence alone, and leaves scenes without cloth as they are."""

    @wraps(render)
    def guarded(scene: Any, *arguments: Any, **named: Any) -> Any:
        before = WITHOUT_CLOTH.set(not any(map(wears_cloth, scene.shapes())))
        try:
            return render(scene, *arguments, **named)
        except RuntimeError as error:
            cause: BaseException | None = error
            while cause is not None and not isinstance(cause, BadInput):
                cause = cause.__cause__
            if cause is None:
                raise
            raise cause from None
        finally:
            WITHOUT_CLOTH.reset(before)

    return guarded
