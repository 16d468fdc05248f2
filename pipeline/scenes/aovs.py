"""Mitsuba's AOVs: what its integrator of that name knows of the surface behind every pixel."""

from __future__ import annotations

from collections.abc import Mapping
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
