"""Every choice of the two views, as named options; nothing heavy is imported here."""

from typing import Final, Literal

from pydantic import Field

from weaves.validation import Frozen

View = Literal["sphere", "plane"]  # the views of one fabric: cloth on a sphere, and on a plane running to the horizon

Bounces = Literal[1, "all"]  # bounces of light: one, as the components have it, or all bounces between diffuse yarns

BOUNCES: Final[Bounces] = "all"  # bounces of light unless others are chosen


class PixelOptions(Frozen):
    """Footprints of pixels, and where they are cut."""

    pixel_sigma: float = Field(default=0.5, gt=0, le=4)
    """Standard deviation of the pixel's Gaussian, in pixels."""
    largest_sigma: float = Field(default=32.0, ge=1, le=1e6)
    """Footprints are cut here, in yarn spacings; a Gaussian of one repeat already is the repeat's average to 4e-16."""
    largest_angle: float = Field(default=88.0, gt=0, le=89.0)
    """Most grazing view of the cloth, in degrees to the normal: beyond, a footprint is seen through many yarns. A view
    shows no cloth there, and the plane ends with the last whole row. In a scene such rays are tilted up to it, for the
    light alone: coverage is that of the ray itself. So are those that an interpolated normal would show the wrong side
    of the cloth."""


class ViewOptions(PixelOptions):
    """Camera, light and scale of the views."""

    footprint: Literal["geometric_mean", "major"] = "major"
    """Axis of the projected pixel that the round footprint takes: the `major` one blurs at grazing views but never
    aliases, so that the truth can judge aliasing; the `geometric_mean` of both keeps the pixel's area, is sharper, and
    shows moire of its own towards the horizon."""
    plane_pixels_per_yarn: float = Field(default=6.0, gt=0, le=1000)
    """Pixels a yarn spacing takes across the bottom row of the plane."""
    horizon: float = Field(default=0.02, ge=0, le=0.9)
    """Height of the picture above the plane's horizon, as a share."""
    turn: float = Field(default=24.0, ge=-180, le=180)
    """Angle from the picture's horizontal to the weft, in degrees."""
    sphere_light: tuple[float, float] = (32.0, 132.0)
    """Light on the sphere, in degrees: angle to the camera's direction, azimuth in the picture from the right."""
    irradiance: float = Field(default=3.141592653589793, gt=0, le=1000)
    """Irradiance of the directional light on a surface facing it; pi shows a white diffuse surface as 1."""
    step: float = Field(default=0.375, gt=0, le=1)
    """How far the surface moves from frame to frame, in pixels (centre of the sphere, bottom row of the plane)."""


class SceneOptions(PixelOptions):
    """How Mitsuba scenes become queries."""

    largest_shear: float = Field(default=90.0, gt=0, le=90)
    """A scene is refused if u and v cross anywhere in sight further from a right angle than this, in degrees. What is
    left of shear is ignored: yarns are taken to cross at right angles, the weft along dp_du. 90: nothing is refused."""
    curvature: Literal["minimum", "at_point", "none"] = "minimum"
    """Curvature of the cloth along the view ray: from the shading normal's derivative `at_point`, concave places being
    flat; the `minimum` of it over the ray's way past the point, where a ray may leave the cloth again; or `none`, for a
    benchmark of flat materials."""
    bounces: Bounces = BOUNCES
    """Bounces of light in pictures: `all` adds what the yarns of a cloth give to each other."""
    environment_directions: int = Field(default=64, ge=4, le=16384)
    """Directions of the quadrature of an environment light: a Fibonacci lattice of equal solid angles."""
    environment_samples: int = Field(default=64, ge=1, le=1024)
    """Places of the environment that each of these directions represents: their mean radiance is the direction's, so
    that the whole light is kept whatever its detail."""
    variant: Literal["auto", "scalar_rgb", "llvm_ad_rgb"] = "auto"
    """Mitsuba's variant. `auto`: the LLVM one where a suitable LLVM is found, which changes last digits only."""
