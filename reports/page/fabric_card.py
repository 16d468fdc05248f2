"""Cards of the fabrics in the gallery of a page."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import numpy.typing as npt

from reports.images.tiles import EXPOSURE, hex_colour
from reports.tables.number_format import plain
from weaves.fabric import Fabric

MOST_CHIPS: Final = 8
"""Most different colours shown of a yarn's threads."""


def fabric_card(fabric: Fabric, role: str) -> dict[str, Any]:
    """Return the title, weave, source and yarns of a fabric as text, and the colours of the yarns."""
    ends, picks = fabric.weave.repeat
    yarns = []
    families = zip(("warp", "weft"), (fabric.warp, fabric.weft), fabric.thread_colours(), strict=True)
    for family, yarn, threads in families:
        numbers = [
            f"{yarn.bend:.3g}°",
            f"{yarn.twist:.3g}°".replace("-", "−"),
            f"{yarn.roughness:.3g}",
            f"{yarn.relief:.3g}",
            f"{yarn.width:.3g}",
        ]
        colours = [(kind, shown) for kind in ("diffuse", "specular") for shown in _chips(getattr(threads, kind))]
        yarns.append({"family": family, "cells": numbers, "colours": colours})
    return {
        "name": fabric.name,
        "title": plain(fabric.name),
        "role": role,
        "weave": fabric.weave.name,
        "repeat": f"{ends} ends × {picks} picks",
        "source": fabric.source,
        "yarns": yarns,
    }


def _chips(threads: npt.NDArray[np.float64]) -> list[str]:
    """Return the different colours of some threads (n, 3) as they are shown, in their order."""
    return list(dict.fromkeys(hex_colour((EXPOSURE * rgb).tolist()) for rgb in threads))[:MOST_CHIPS]
