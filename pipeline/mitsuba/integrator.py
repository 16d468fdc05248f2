"""The integrator `twillight_path`: a path tracer whose rays know their footprint at every bounce.

    {"type": "twillight_path", "max_depth": 8, "rr_depth": 5, "hide_emitters": False}

Otherwise it is Mitsuba's `path`. At the camera a ray's footprint is a pixel's Gaussian less the variance that the
film's filter adds, so that cloth is equally sharp with any number of samples.

At every bounce each emitter is sampled, because a choice between sun and sky is noisier than cloth; one at random in a
scene with more than `MOST_EMITTERS`, or with a `sampling_weight` that is not 1. Both ways to a light are weighted by
the power heuristic [Veach1995Combining].
A footprint after a bounce is a disc across the ray, of deviation

    sqrt(width^2 + blur^2),    width += spread t,    blur += scatter t

with `width` and `spread` of the camera's cone. `scatter` gathers earlier bounces: a direction of density p stands for
the solid angle 1/p, a disc of variance 1/(4 pi p) along each axis [Bekaert2003Footprint]. Light straight through gaps
and other delta lobes scatter nothing.

Where a ray meets cloth, the shading normal's derivatives (`si.dn_du`, `si.dn_dv`) become those of a sphere that curves
as the shape does along the view ray. That is measured by two more rays, as in `pipeline.scenes.places`; `_STEP` units
of u are a tenth of a yarn spacing by default. A ray that leaves a silhouette again goes on where it leaves the shape.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any, Final

import drjit as dr
import mitsuba as mi
import numpy as np
from pydantic import Field

from pipeline.mitsuba.bsdf import BSDF, wears_cloth
from pipeline.mitsuba.worn import PIXEL
from pipeline.scenes.loading import refuse_mesh
from weaves.validation import Frozen, validated

INTEGRATOR: Final = "twillight_path"

MOST_RAYS: Final = 2**18  # most rays that are traced at a time; a ray takes about a kilobyte

MOST_EMITTERS: Final = 4  # emitters that are sampled each

MOST_SCATTER: Final = 0.5
"""Largest square of `scatter`, in radians squared: that of a direction drawn evenly from a hemisphere."""

tracked: Callable[[Sequence[int], str], Iterable[int]] | None = None
"""Returns the parts of a picture while it shows what is done; `twillight_mitsuba` sets it to a bar."""

_STEP = 1e-3  # units of u


class PathOptions(Frozen):
    """Properties of the integrator; they mean what they mean for Mitsuba's `path`, but for `hide_emitters`."""

    max_depth: int = Field(default=-1, ge=-1)
    """Longest path; 1 shows lights only, 2 light scattered once; -1: no limit."""
    rr_depth: int = Field(default=5, ge=1)
    """Length from which on paths end at random."""
    hide_emitters: bool = False
    """True hides the light of emitters that the camera sees; Mitsuba's `path` hides their surface too."""


@contextmanager
def evaluated() -> Iterator[None]:
    """Let Dr.Jit evaluate loops and calls at once, not record them: NumPy answers queries, and cannot be recorded.

    The integrator `twillight_path` does so itself, others need it around them. Only inside: there Mitsuba's `aov` gives
    wrong normals, and `path` loses light (version 3.9.1).

    Examples
    --------
    >>> mi.set_variant("scalar_rgb")
    >>> with evaluated():
    ...     pass  # mi.render(scene, integrator=mi.load_dict({"type": "path"}))
    """
    with ExitStack() as stack:
        for name in ("SymbolicCalls", "SymbolicLoops", "SymbolicConditionals"):
            stack.enter_context(dr.scoped_set_flag(getattr(dr.JitFlag, name), False))
        yield


def integrator_class() -> type[Any]:
    """Return the class of the plugin for the variant of Mitsuba that is set."""

    class TwillightPath(mi.SamplingIntegrator):
        """Path tracer with footprints."""

        def __init__(self, props: Any) -> None:
            mi.SamplingIntegrator.__init__(self, props)
            given = {name: props[name] for name in props.keys()}  # noqa: SIM118, not a mapping
            self._options = validated(PathOptions, given, f"integrator {INTEGRATOR}")
            self._samples, self._deviation = 0, PIXEL

        def render(
            self, scene: Any, sensor: Any = 0, seed: Any = 0, spp: int = 0, develop: bool = True, evaluate: bool = True
        ) -> Any:
            """Render the scene, as all integrators of Mitsuba do.

            Pictures of more than `MOST_RAYS` rays are the mean of several, with a bar on a terminal; the film then
            keeps the last one only. BadInput if a mesh that wears the BSDF `twillight` has no uv coordinates, or is
            bent and has no vertex normals.
            """
            # Mitsuba calls this function again, for each part.
            if self._samples:
                return super().render(scene, sensor, seed, spp, develop, evaluate)
            for shape in filter(wears_cloth, scene.shapes()):
                refuse_mesh(mi, shape, "scene", BSDF)
            seen = sensor if isinstance(sensor, mi.Sensor) else scene.sensors()[sensor]
            samples = spp or seen.sampler().sample_count()
            self._deviation = ray_deviation(seen.film().rfilter(), samples)
            parts = _parts(samples, int(np.prod(seen.film().crop_size())))
            self._samples = samples
            try:
                with evaluated():
                    if len(parts) == 1 or not develop:
                        return super().render(scene, sensor, seed, spp, develop, evaluate)
                    means = (
                        super(TwillightPath, self).render(scene, sensor, seed + (number << 16), part, True, evaluate)
                        * (part / samples)
                        for number, part in enumerate(tracked(parts, "rendering") if tracked else parts)
                    )
                    return sum(means)
            finally:
                self._samples = 0

        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            """Return the radiance along rays, whether they hit anything, and no further channels."""
            # Mitsuba has divided differentials by the root of the samples.
            ray.scale_differential(self._deviation / PIXEL * math.sqrt(sampler.sample_count()))
            return (*_Path(scene, sampler, self._options).trace(ray, mi.Bool(active)), [])

        def to_string(self) -> str:
            """Return the properties as text."""
            return f"{INTEGRATOR}[{self._options}]"

    return TwillightPath


def _parts(samples: int, pixels: int) -> list[int]:
    """Return numbers of samples that add up, of at most `MOST_RAYS` rays where a sample has no more."""
    count = min(samples, -(-samples * pixels // MOST_RAYS))
    return [samples // count + (index < samples % count) for index in range(count)]


def ray_deviation(rfilter: Any, samples: int) -> float:
    """Return the deviation of a ray's own Gaussian, in pixels.

    Its variance and that of the film's filter add up to a pixel's, `PIXEL` squared. Under a wider filter it is `PIXEL`
    over the root of the samples, half of `PIXEL` at most: samples of all pixels in the filter's reach count.
    """
    radius = float(np.asarray(rfilter.radius()).item())
    x = radius * (np.arange(256) + 0.5) / 256.0
    weight = np.array([float(np.asarray(rfilter.eval(float(place))).item()) for place in x])
    spread = float((x * x) @ weight / weight.sum())
    return math.sqrt(max(PIXEL**2 - spread, PIXEL**2 / max(samples, 4)))


class _Path:
    """Paths of one set of rays: a loop over bounces in Python, each of which is evaluated at once."""

    def __init__(self, scene: Any, sampler: Any, options: PathOptions) -> None:
        self._scene, self._sampler, self._options = scene, sampler, options
        emitters = scene.emitters()
        self._to_light = [partial(scene.sample_emitter_direction, test_visibility=False)]
        if len(emitters) <= MOST_EMITTERS and all(emitter.sampling_weight() == 1.0 for emitter in emitters):
            self._to_light = [emitter.sample_direction for emitter in emitters]
        self._scalar = str(mi.variant()).startswith("scalar")
        self._context = mi.BSDFContext()
        # Flags that cloth alone has together.
        self._cloth = int(mi.BSDFFlags.Null | mi.BSDFFlags.NonSymmetric | mi.BSDFFlags.DiffuseTransmission)

    def trace(self, ray: Any, active: Any) -> tuple[Any, Any]:
        """Return the radiance along rays with differentials, and whether they hit anything."""
        cone, sampler = _Cone(), self._sampler
        light, throughput, valid = mi.Spectrum(0.0), mi.Spectrum(1.0), mi.Bool(False)
        # Where paths come from, the density of their direction, and whether it is that of a delta lobe.
        place, pdf, delta = dr.zeros(mi.SurfaceInteraction3f), mi.Float(1.0), mi.Bool(True)
        depth = 0
        while True:
            si = self._scene.ray_intersect(ray, active)
            if depth == 0:
                valid = si.is_valid()
            if depth > 0 or not self._options.hide_emitters:
                light += throughput * self._emitted(si, place, pdf, delta, active)
            depth += 1
            active = active & si.is_valid()
            if depth == self._options.max_depth or not dr.any(active):
                break
            cone.meet(ray, si)
            chord = self._bend(si, active)
            lobe, direction, end = sampler.next_1d(), sampler.next_2d(), sampler.next_1d()
            self._evaluate(si, lobe, direction, end, active, cone.state)
            for to_light in self._to_light:
                light += throughput * self._lit(si, to_light, active)
            drawn, weight = si.bsdf().sample(self._context, si, lobe, direction, active)
            throughput *= weight
            place, pdf, delta = si, drawn.pdf, mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
            cone.scatter(pdf, delta)
            ray = mi.RayDifferential3f(si.spawn_ray(si.to_world(drawn.wo)))
            self._leave(ray, si, chord, active & delta)
            largest = dr.max(throughput)
            active = active & (largest > 0.0)
            if depth >= self._options.rr_depth:
                kept = dr.minimum(largest, 0.95)
                active = active & (end < kept)
                throughput /= dr.maximum(kept, 1e-8)
            self._evaluate(light, throughput, active, ray, pdf, delta, cone.state)
        return light, valid

    def _bend(self, si: Any, active: Any) -> Any:
        """Set the normal's derivatives where rays meet cloth; return how long a ray is inside that leaves it again."""
        cloth = active & ((si.bsdf().flags() & self._cloth) == self._cloth)
        normal, step = si.sh_frame.n, _STEP * dr.norm(si.dp_du)
        viewer = si.to_world(si.wi)
        along = viewer - normal * dr.dot(viewer, normal)
        length = dr.norm(along)
        tangent = dr.select(length > 1e-6, along / dr.maximum(length, 1e-6), si.sh_frame.s)
        moved, turned = mi.Float(0.0), mi.Vector3f(0.0)
        for sign in (1.0, -1.0):
            hit = self._scene.ray_intersect(mi.Ray3f(si.p + step * (sign * tangent + normal), -normal), cloth)
            near = hit.is_valid() & (hit.t < 3.0 * step) & (dr.dot(hit.sh_frame.n, normal) > 0.0)
            near = near & (hit.shape == si.shape)
            moved += dr.select(near, step, 0.0)
            turned += sign * dr.select(near, hit.sh_frame.n, normal)
        slope = si.wi.z / dr.maximum(length, 1e-6)
        kappa = dr.dot(turned, tangent) / dr.maximum(moved, 1e-12)
        kappa = dr.select(cloth & (kappa > 0.0) & (si.wi.z > 0.0) & (moved > 0.0), kappa, 0.0)
        si.dn_du, si.dn_dv = kappa * si.dp_du, kappa * si.dp_dv
        return dr.select(kappa > 0.0, 2.0 * slope / dr.maximum(kappa, 1e-12), 0.0)

    def _leave(self, ray: Any, si: Any, chord: Any, straight: Any) -> None:
        """Let rays that go straight on inside a bend start where they leave the shape, about a chord further on."""
        passing = straight & (chord > 0.0)
        if not dr.any(passing):
            return
        hit = self._scene.ray_intersect(ray, passing)
        out = passing & hit.is_valid() & (hit.t < 2.0 * chord) & (dr.dot(ray.d, hit.n) > 0.0)
        out = out & (hit.shape == si.shape)
        ray.o = dr.select(out, hit.spawn_ray(ray.d).o, ray.o)

    def _emitted(self, si: Any, place: Any, pdf: Any, delta: Any, active: Any) -> Any:
        """Return the light of emitters that rays hit, weighted against `_lit`."""
        scene = self._scene
        emitter = si.emitter(scene, active)
        if self._scalar and emitter is None:
            return mi.Spectrum(0.0)
        emitted = mi.DirectionSample3f(scene, si, place)
        sampled = active & ~delta if not self._scalar else active and not delta
        other = scene.pdf_emitter_direction(place, emitted, sampled) if dr.any(sampled) else mi.Float(0.0)
        other *= len(self._to_light)  # a scene's density is that of one of its emitters, drawn at random
        return dr.select(delta, 1.0, _heuristic(pdf, other)) * emitter.eval(si, active)

    def _lit(self, si: Any, to_light: Callable[..., Any], active: Any) -> Any:
        """Return the light of an emitter in a direction to it, weighted against `_emitted`."""
        wanted = active & mi.has_flag(si.bsdf().flags(), mi.BSDFFlags.Smooth)
        towards, power = to_light(si, self._sampler.next_2d(), active=wanted)
        wanted = wanted & (towards.pdf != 0.0) & (dr.max(power) > 0.0)
        wanted = wanted & (self._scene.ray_test(si.spawn_ray_to(towards.p), wanted) != wanted)
        if not dr.any(wanted):
            return mi.Spectrum(0.0)
        wo = si.to_local(towards.d)
        self._evaluate(wo, wanted, power, towards)
        value, pdf = si.bsdf().eval_pdf(self._context, si, wo, wanted)
        return dr.select(wanted, dr.select(towards.delta, 1.0, _heuristic(towards.pdf, pdf)) * value * power, 0.0)

    def _evaluate(self, *values: Any) -> None:
        if not self._scalar:
            self._sampler.schedule_state()
            dr.eval(*values)


def _heuristic(own: Any, other: Any) -> Any:
    """Return own^2 / (own^2 + other^2), 0 where both are 0."""
    sum_of_squares = own * own + other * other
    return dr.select(sum_of_squares > 0.0, own * own / dr.maximum(sum_of_squares, 1e-30), 0.0)


class _Cone:
    """Footprints of rays along their paths: `state` is width, spread, blur and scatter, empty before the first hit."""

    def __init__(self) -> None:
        self.state: tuple[Any, ...] = ()

    def meet(self, ray: Any, si: Any) -> None:
        """Set the partial derivatives of what rays meet; those of the first rays are their own."""
        if not self.state:
            self.state = self._start(ray, si)
            return
        width, spread, blur, scatter = self.state
        width, blur = width + spread * si.t, blur + scatter * si.t
        self.state = (width, spread, blur, scatter)
        size = dr.sqrt(width * width + blur * blur) / PIXEL
        across, along = mi.coordinate_system(ray.d)
        # Parallel rays through the disc: their places on the tangent plane are its footprint.
        beside = mi.RayDifferential3f(ray)
        beside.o_x, beside.o_y = ray.o + across * size, ray.o + along * size
        beside.d_x, beside.d_y = ray.d, ray.d
        beside.has_differentials = True
        si.compute_uv_partials(beside)

    def scatter(self, pdf: Any, delta: Any) -> None:
        """Widen the rays by a bounce into a direction of this density."""
        *others, scatter = self.state
        added = dr.minimum(1.0 / (4.0 * math.pi * dr.maximum(pdf, 1e-6)), MOST_SCATTER)
        square = scatter * scatter + dr.select(delta, 0.0, added)
        self.state = (*others, dr.sqrt(dr.minimum(square, MOST_SCATTER)))

    def _start(self, ray: Any, si: Any) -> tuple[Any, ...]:
        none = mi.Float(0.0)
        if not ray.has_differentials:
            return (none,) * 4
        si.compute_uv_partials(ray)
        right, down = (si.dp_du * change.x + si.dp_dv * change.y for change in (si.duv_dx, si.duv_dy))
        width = PIXEL * dr.sqrt(dr.abs(dr.dot(dr.cross(right, down), ray.d)))
        known = dr.isfinite(width) & (si.t > 0.0)
        spread = dr.select(known, width / dr.maximum(si.t, 1e-12), 0.0)
        return (dr.select(known, width, 0.0), spread, none, none)
