"""The BSDF `twillight`: a cloth's patch BSDF as a plugin of Mitsuba.

    {"type": "twillight", "fabric": "denim", "yarns": 400.0}

Properties are the fields of `pipeline.mitsuba.options.ClothOptions`. A footprint is, in this order: the property
`sigma`; the ray's partial derivatives (`si.duv_dx`, `si.duv_dy`), which the integrator `twillight_path` keeps at every
bounce; the property `pixel_angle`. Components: 0 reflection, 1 transmission, 2 light straight through gaps and yarns,
which neither `eval` nor `pdf` knows, because it is a delta lobe (Null). Cloth counts as flat across a footprint.
"""

from __future__ import annotations

from functools import reduce
from operator import or_
from typing import Any, Final

import numpy as np

from pipeline.compiled.arrays import Float32, Float64, Index, Mask
from pipeline.mitsuba.columns import Columns
from pipeline.mitsuba.options import ClothOptions
from pipeline.mitsuba.worn import Hits, Worn
from weaves.errors import BadInput
from weaves.validation import validated

NAME: Final = "twillight"
"""Name of the plugin."""

REFLECTION, TRANSMISSION, STRAIGHT = range(3)
"""Components."""


def bsdf_class(mi: Any, dr: Any) -> type[Any]:
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

    class Twillight(mi.BSDF):  # type: ignore[misc]  # Mitsuba has no types
        """Woven cloth."""

        def __init__(self, props: Any) -> None:
            mi.BSDF.__init__(self, props)
            given = {name: props[name] for name in props.keys()}  # noqa: SIM118, not a mapping
            self._worn = Worn(validated(ClothOptions, given, f"bsdf {NAME}"))
            self.m_components = [reduce(or_, kind, everywhere) for kind in kinds]
            self.m_flags = reduce(or_, self.m_components)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return the BSDF times the cosine to wo."""
            return self._evaluated(ctx, si, wo, active, values=True, density=False)[0]

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            """Return the density with which `sample` draws wo, 1/sr."""
            return self._evaluated(ctx, si, wo, active, values=False, density=True)[1]

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> tuple[Any, Any]:
            """Return `eval` and `pdf`."""
            return self._evaluated(ctx, si, wo, active, values=True, density=True)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> tuple[Any, Any]:
            """Draw a direction; return it and the BSDF times its cosine, over its density."""
            columns, rows, hits = _hits(mi, dr, si, active, sample1, sample2)
            random = np.column_stack([columns.number(sample1), columns.vector(sample2)])[rows]
            wo, pdf, straight, weight = self._worn.sample(hits, random) if len(rows) else _NOTHING
            component = np.where(straight, STRAIGHT, _component(hits, wo))
            weight = np.where(enabled(ctx, component)[:, None], weight, 0.0)
            found = mi.BSDFSample3f()
            found.wo = columns.to_mitsuba(mi.Vector3f, wo, rows)
            found.pdf = columns.to_mitsuba(mi.Float, pdf, rows)
            found.eta = columns.to_mitsuba(mi.Float, np.ones(len(rows)), rows, 1.0)
            found.sampled_type = columns.to_mitsuba(mi.UInt32, types[component], rows)
            found.sampled_component = columns.to_mitsuba(mi.UInt32, component, rows)
            return found, columns.to_mitsuba(mi.Spectrum, weight, rows)

        def eval_null_transmission(self, si: Any, active: Any = True) -> Any:
            """Return the share of light that goes straight through."""
            columns, rows, hits = _hits(mi, dr, si, active)
            share = self._worn.transparency(hits) if len(rows) else np.empty(0)
            return columns.to_mitsuba(mi.Spectrum, np.repeat(share[:, None], 3, axis=1), rows)

        def to_string(self) -> str:
            """Return the properties as text."""
            return f"{NAME}[{self._worn.options}]"

        def _evaluated(self, ctx: Any, si: Any, wo: Any, active: Any, values: bool, density: bool) -> tuple[Any, Any]:
            columns, rows, hits = _hits(mi, dr, si, active, wo)
            light = columns.vector(wo)[rows]
            rgb, pdf = np.zeros((len(rows), 3)), np.zeros(len(rows))
            if len(rows):
                kept = enabled(ctx, _component(hits, light))
                if values:
                    rgb = np.where(kept[:, None], self._worn.eval(hits, light), 0.0)
                if density:
                    pdf = np.where(kept, self._worn.pdf(hits, light), 0.0)
            return columns.to_mitsuba(mi.Spectrum, rgb, rows), columns.to_mitsuba(mi.Float, pdf, rows)

    return Twillight


_NOTHING: Any = (np.empty((0, 3)), np.empty(0), np.empty(0, np.bool_), np.empty((0, 3)))


def _hits(mi: Any, dr: Any, si: Any, active: Any, *others: Any) -> tuple[Columns, Index, Hits]:
    """Return the active rows with a viewer on either side, and what they meet; `others` have the same length."""
    scalar = mi.variant().startswith("scalar")
    if not scalar and dr.flag(dr.JitFlag.SymbolicScope):
        allowed = "render inside `with twillight_mitsuba.evaluated():`"
        raise BadInput(f"bsdf {NAME}", "", "a recorded loop", allowed)
    normal, du = si.sh_frame.n, si.dp_du
    handed = dr.dot(dr.cross(du, si.dp_dv), normal)
    names = (si.uv, si.wi, si.to_local(si.n), si.duv_dx, si.duv_dy)
    numbers = (handed, si.t, dr.norm(du))
    if not scalar:
        dr.eval(names, numbers, active)
    columns = Columns(mi, 1 if scalar else dr.width((names, numbers, active, *others)))
    rows = columns.active(active)
    uv, viewer, outward, duv_dx, duv_dy = (columns.vector(value)[rows] for value in names)
    handed, distance, length = (columns.number(value)[rows] for value in numbers)
    seen, traced = np.abs(viewer[:, 2]) > 0.0, np.isfinite(distance) & (length > 0.0)
    hits = Hits(
        uv,
        viewer,
        outward,
        np.where(handed < 0.0, -1.0, 1.0),
        np.stack([duv_dx, duv_dy], axis=-1),
        np.where(traced, distance, 0.0) / np.where(traced, length, 1.0),
    )
    return columns, rows[seen], Hits(*(column[seen] for column in hits))


def _component(hits: Hits, light: Float64 | Float32) -> Index:
    """Return the component of each light, (N,)."""
    return np.where(hits.viewer[:, 2] * light[:, 2] < 0.0, TRANSMISSION, REFLECTION)
