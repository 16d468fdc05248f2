"""The BSDF `twillight`: a cloth's patch BSDF as a plugin of Mitsuba.

    {"type": "twillight", "fabric": "denim", "yarns": 400.0}

Properties are the fields of `pipeline.mitsuba.worn.ClothOptions`. A footprint is, in this order: the property
`sigma`; the ray's partial derivatives (`si.duv_dx`, `si.duv_dy`), which the integrator `twillight_path` keeps at every
bounce; the property `pixel_angle`. Components: 0 reflection, 1 transmission, 2 light straight through gaps and yarns
and past silhouettes, which neither `eval` nor `pdf` knows, because it is a delta lobe (Null). Cloth curves along the
view ray as the shading normal's derivatives say (`si.dn_du`, `si.dn_dv`), which that integrator sets; it counts as flat
where they are 0. `mi.traverse` offers the colours of the yarns.
"""

from contextvars import ContextVar
from functools import reduce
from operator import or_
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Index, Mask
from pipeline.mitsuba.worn import ClothOptions, RayHits, Worn
from weaves.errors import BadInput
from weaves.validation import validated

BSDF: Final = "twillight"

REFLECTION, TRANSMISSION, STRAIGHT_THROUGH = range(3)  # components

WITHOUT_CLOTH: Final = ContextVar("WITHOUT_CLOTH", default=False)
"""True while a scene without cloth is rendered: Dr.Jit records the BSDFs of other scenes in memory all the same."""


def wears_cloth(shape: Any) -> bool:
    """Return whether a shape's BSDF is a cloth, or has one inside."""
    return shape.bsdf() is not None and f"{BSDF}[" in str(shape.bsdf())


class RayValues:
    """Values of Mitsuba as NumPy arrays with one row a ray (one ray if the variant is scalar), and back."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._scalar = str(mi.variant()).startswith("scalar")

    def number(self, value: Any) -> Float64:
        """Return a number of each ray, (N,)."""
        return np.broadcast_to(np.asarray(value, np.float64).reshape(-1), (self._count,))

    def vector(self, value: Any) -> Float64:
        """Return the vector of each ray, (N, its length)."""
        rows = np.asarray(value, np.float64)
        rows = rows.reshape(len(rows), -1).T
        return np.broadcast_to(rows, (self._count, rows.shape[1]))

    def active(self, value: Any) -> Index:
        """Return which rays are active."""
        return np.flatnonzero(np.broadcast_to(np.asarray(value, np.bool_).reshape(-1), (self._count,)))

    def to_mitsuba(self, kind: Any, values: Any, rows: Index, elsewhere: float = 0.0) -> Any:
        """Return numbers (n,) or vectors (n, c) of the rays `rows` as Mitsuba's `kind`; other rays have `elsewhere`."""
        values = np.asarray(values)
        if self._scalar:
            if values.ndim == 1:
                return kind(values[0].item() if len(rows) else elsewhere)
            return kind(*(values[0].tolist() if len(rows) else [elsewhere] * values.shape[1]))
        type_of = np.uint32 if kind is mi.UInt32 else np.bool_ if kind is mi.Bool else np.float32
        whole = np.full((self._count, *values.shape[1:]), elsewhere, type_of)
        whole[rows] = values
        return kind(np.ascontiguousarray(whole.T))


def bsdf_class() -> type[Any]:
    """Return the class of the plugin for the variant of Mitsuba that is set."""
    flags = mi.BSDFFlags
    everywhere = flags.FrontSide | flags.BackSide | flags.Anisotropic | flags.SpatiallyVarying | flags.NonSymmetric
    kinds = (
        (flags.DiffuseReflection, flags.GlossyReflection),
        (flags.DiffuseTransmission, flags.GlossyTransmission),
        (flags.Null,),
    )
    types = np.array([int(kind[-1]) for kind in kinds])

    def enabled(ctx: Any, component: Index) -> Mask:
        """Return which of N components a context wants."""
        wanted = [any(ctx.is_enabled(flag, index) for flag in kind) for index, kind in enumerate(kinds)]
        return np.asarray(wanted)[component]

    class Twillight(mi.BSDF):
        """Woven cloth."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            given = {name: props[name] for name in props.keys()}  # noqa: SIM118, not a mapping
            self._worn = Worn(validated(ClothOptions, given, f"bsdf {BSDF}"))
            self._colours = {name: mi.Color3f(*rgb) for name, rgb in self._worn.colours().items()}
            self.m_components = [reduce(or_, kind, everywhere) for kind in kinds]
            self.m_flags = reduce(or_, self.m_components)

        def traverse(self, callback: Any) -> None:
            """Offer the colours of the yarns, linear RGB, to `mi.traverse`."""
            for name, colour in self._colours.items():
                callback.put(name, colour, mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, keys: Any = ()) -> None:
            """Take edited colours; BadInput if yarns would make light."""
            edited = {name: np.asarray(colour, np.float64).ravel().tolist() for name, colour in self._colours.items()}
            self._worn = self._worn.dyed(edited)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return the BSDF times the cosine to wo."""
            return self.eval_pdf(ctx, si, wo, active)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return the density with which `sample` draws wo, 1/sr."""
            return self.eval_pdf(ctx, si, wo, active)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            """Return `eval` and `pdf`."""
            if _recorded():
                return mi.Spectrum(0.0), mi.Float(0.0)
            columns, rows, hits = _hits(si, active, wo)
            light = columns.vector(wo)[rows]
            rgb, pdf = np.zeros((len(rows), 3)), np.zeros(len(rows))
            if len(rows):
                kept = enabled(ctx, _component(hits, light))
                rgb = np.where(kept[:, None], self._worn.eval(hits, light), 0.0)
                pdf = np.where(kept, self._worn.pdf(hits, light), 0.0)
            return columns.to_mitsuba(mi.Spectrum, rgb, rows), columns.to_mitsuba(mi.Float, pdf, rows)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
            """Draw a direction; return it and the BSDF times its cosine, over its density."""
            if _recorded():
                return dr.zeros(mi.BSDFSample3f), mi.Spectrum(0.0)
            columns, rows, hits = _hits(si, active, sample1, sample2)
            random = np.column_stack([columns.number(sample1), columns.vector(sample2)])[rows]
            wo, pdf, straight, weight = self._worn.sample(hits, random) if len(rows) else _NOTHING
            component = np.where(straight, STRAIGHT_THROUGH, _component(hits, wo))
            weight = np.where(enabled(ctx, component)[:, None], weight, 0.0)
            drawn = mi.BSDFSample3f()
            drawn.wo = columns.to_mitsuba(mi.Vector3f, wo, rows)
            drawn.pdf = columns.to_mitsuba(mi.Float, pdf, rows)
            drawn.eta = columns.to_mitsuba(mi.Float, np.ones(len(rows)), rows, 1.0)
            drawn.sampled_type = columns.to_mitsuba(mi.UInt32, types[component], rows)
            drawn.sampled_component = columns.to_mitsuba(mi.UInt32, component, rows)
            return drawn, columns.to_mitsuba(mi.Spectrum, weight, rows)

        def eval_null_transmission(self, si: Any, active: Any = True) -> Any:
            """Return the share of light that goes straight through, or past a silhouette."""
            if _recorded():
                return mi.Spectrum(0.0)
            columns, rows, hits = _hits(si, active)
            share = self._worn.transparency(hits) if len(rows) else np.empty(0)
            return columns.to_mitsuba(mi.Spectrum, np.repeat(share[:, None], 3, axis=1), rows)

        def to_string(self) -> str:
            """Return the properties as text."""
            return f"{BSDF}[{self._worn.options}]"

    return Twillight


_NOTHING: Any = (np.empty((0, 3)), np.empty(0), np.empty(0, np.bool_), np.empty((0, 3)))


def _recorded() -> bool:
    """Return whether Dr.Jit records a call that no ray of a scene without cloth makes; BadInput if rays make it."""
    if str(mi.variant()).startswith("scalar") or not dr.flag(dr.JitFlag.SymbolicScope):
        return False
    if not WITHOUT_CLOTH.get():
        allowed = "use the integrator twillight_path; direct and prb work inside `with twillight_mitsuba.evaluated():`"
        raise BadInput(f"bsdf {BSDF}", "", "an integrator that Dr.Jit records", allowed)
    return True


def _hits(si: Any, active: Any, *others: Any) -> tuple[RayValues, Index, RayHits]:
    """Return the active rows with a viewer on either side, and what they meet; `others` have the same length."""
    scalar = str(mi.variant()).startswith("scalar")
    normal, du = si.sh_frame.n, si.dp_du
    handed = dr.dot(dr.cross(du, si.dp_dv), normal)
    stride, bend = _curved(si)
    names = (si.uv, si.wi, si.to_local(si.n), si.duv_dx, si.duv_dy)
    numbers = (handed, si.t, dr.norm(du), *stride, bend)
    if not scalar:
        dr.eval(names, numbers, active)
    columns = RayValues(1 if scalar else dr.width((names, numbers, active, *others)))
    rows = columns.active(active)
    uv, viewer, outward, duv_dx, duv_dy = (columns.vector(value)[rows] for value in names)
    handed, distance, length, along_u, along_v, bend = (columns.number(value)[rows] for value in numbers)
    seen, traced = np.abs(viewer[:, 2]) > 0.0, np.isfinite(distance) & (length > 0.0)
    handed, spread = np.where(handed < 0.0, -1.0, 1.0), np.where(traced, distance, 0.0) / np.where(traced, length, 1.0)
    jacobian, strides = np.stack([duv_dx, duv_dy], axis=-1), np.stack([along_u, along_v], axis=-1)
    hits = (uv, viewer, outward, handed, jacobian, spread, strides, bend)
    return columns, rows[seen], RayHits(*(column[seen] for column in hits))


def _curved(si: Any) -> tuple[tuple[Any, Any], Any]:
    """Return the change of u and v with the length towards the viewer, and the curvature that way; 0 if not known."""
    du, dv, normal, viewer = si.dp_du, si.dp_dv, si.sh_frame.n, si.to_world(si.wi)
    along = viewer - normal * dr.dot(viewer, normal)
    tangent = along / dr.maximum(dr.norm(along), 1e-12)
    first, mixed, second = dr.dot(du, du), dr.dot(du, dv), dr.dot(dv, dv)
    area = first * second - mixed * mixed
    scale = dr.select(area > 0.0, 1.0 / dr.maximum(area, 1e-30), 0.0)
    on_u, on_v = dr.dot(tangent, du), dr.dot(tangent, dv)
    stride = scale * (second * on_u - mixed * on_v), scale * (first * on_v - mixed * on_u)
    return stride, dr.dot(si.dn_du * stride[0] + si.dn_dv * stride[1], tangent)


def _component(hits: RayHits, light: Float64 | Float32) -> Index:
    return np.where(hits.viewer[:, 2] * light[:, 2] < 0.0, TRANSMISSION, REFLECTION)
