"""Mitsuba's AOVs: what its integrator of that name knows of the surface behind every pixel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt


def aovs_of(mi: Any, world: Any, sensor: Any, channels: Mapping[str, int]) -> dict[str, npt.NDArray[np.float64]]:
    """Render AOVs with one ray a pixel.

    Parameters
    ----------
    mi, world, sensor : Any
        The module mitsuba, a scene, and a camera whose filter is a box.
    channels : dict
        Which AOVs, and how many channels each has.

    Returns
    -------
    dict of float64 (H, W, channels)
        By name; 0 where a ray hits nothing.
    """
    integrator = mi.load_dict({"type": "aov", "aovs": ",".join(f"{name}:{name}" for name in channels)})
    planes = np.asarray(mi.render(world, sensor=sensor, integrator=integrator, spp=1), np.float64)
    ends = np.cumsum(list(channels.values()))[:-1]
    return dict(zip(channels, np.split(planes, ends, axis=-1), strict=True))


def shape_numbers(mi: Any, shapes: Sequence[Any]) -> list[int]:
    """Return the number that the AOV `shape_index` has where each of a scene's shapes is seen.

    That is 1, 2, … in the order of the scene in Mitsuba's scalar variants. In the others it is the number under which
    Mitsuba has registered the shape, which depends on what was made first.
    """
    if mi.variant().startswith("scalar"):
        return list(range(1, len(shapes) + 1))
    import drjit

    numbers: list[Any] = [drjit.reinterpret_array(mi.UInt32, mi.ShapePtr(shape)) for shape in shapes]
    return [int(number[0]) for number in numbers]
