"""The integrator `twillight_path`: a path tracer whose rays know their footprint at every bounce.

    {"type": "twillight_path", "max_depth": 8, "rr_depth": 5, "hide_emitters": False}

Otherwise it is Mitsuba's `path`. At the camera a ray's footprint is a pixel's Gaussian less the variance that the
film's filter adds, so that cloth is equally sharp with any number of samples; pipeline.mitsuba.path has the rest.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from pipeline.mitsuba import bsdf
from pipeline.mitsuba.evaluated import evaluated
from pipeline.mitsuba.footprint import PIXEL
from pipeline.mitsuba.path import Path
from pipeline.scenes.loading import has_uv
from weaves.errors import BadInput
from weaves.validation import validated

NAME: Final = "twillight_path"
"""Name of the plugin."""


MOST_RAYS: Final = 2**20
"""Most rays that are traced at a time; a ray takes about a kilobyte."""


class PathOptions(BaseModel):
    """Properties of the integrator; they mean what they mean for Mitsuba's `path`."""

    model_config = ConfigDict(frozen=True, extra="forbid", use_attribute_docstrings=True)

    max_depth: int = Field(default=-1, ge=-1)
    """Longest path; 1 shows lights only, 2 light scattered once; -1: no limit."""
    rr_depth: int = Field(default=5, ge=1)
    """Length from which on paths end at random."""
    hide_emitters: bool = False
    """True hides lights that the camera sees."""


def integrator_class(mi: Any, dr: Any) -> type[Any]:
    """Return the class of the plugin for the variant of Mitsuba that is set."""

    class TwillightPath(mi.SamplingIntegrator):  # type: ignore[misc]  # Mitsuba has no types
        """Path tracer with footprints."""

        def __init__(self, props: Any) -> None:
            mi.SamplingIntegrator.__init__(self, props)
            given = {name: props[name] for name in props.keys()}  # noqa: SIM118, not a mapping
            self._options = validated(PathOptions, given, f"integrator {NAME}")
            self._samples, self._deviation = 0, PIXEL

        def render(
            self, scene: Any, sensor: Any = 0, seed: Any = 0, spp: int = 0, develop: bool = True, evaluate: bool = True
        ) -> Any:
            """Render the scene, as all integrators of Mitsuba do.

            Pictures of more than `MOST_RAYS` rays are the mean of several; the film then keeps the last one only.

            Raises
            ------
            BadInput
                If a mesh that wears the BSDF `twillight` has no uv coordinates.
            """
            # Mitsuba calls this function again, for each part.
            if self._samples:
                return super().render(scene, sensor, seed, spp, develop, evaluate)
            _refuse_bare(mi, scene)
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
                        for number, part in enumerate(parts)
                    )
                    return sum(means)
            finally:
                self._samples = 0

        def sample(self, scene: Any, sampler: Any, ray: Any, medium: Any = None, active: Any = True) -> Any:
            """Return the radiance along rays, whether they hit anything, and no further channels."""
            # Mitsuba has divided differentials by the root of the samples.
            ray.scale_differential(self._deviation / PIXEL * math.sqrt(sampler.sample_count()))
            options = self._options
            path = Path(mi, dr, scene, sampler, options.max_depth, options.rr_depth, options.hide_emitters)
            return (*path.trace(ray, mi.Bool(active)), [])

        def to_string(self) -> str:
            """Return the properties as text."""
            return f"{NAME}[{self._options}]"

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


def _refuse_bare(mi: Any, scene: Any) -> None:
    """Refuse a scene in which a mesh wears cloth and has no uv coordinates."""
    for shape in scene.shapes():
        worn = shape.bsdf() is not None and str(shape.bsdf()).startswith(f"{bsdf.NAME}[")
        if worn and shape.is_mesh() and not has_uv(mi, shape):
            name = shape.id() or shape.class_name()
            raise BadInput("scene", "shape", name, f"a shape that wears {bsdf.NAME} needs uv coordinates")
