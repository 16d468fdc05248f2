"""Cards of the fabrics in the gallery of a page."""

from __future__ import annotations

from typing import Any

from reports.images.tiles import EXPOSURE, hex_colour
from reports.tables.number_format import plain
from weaves.fabric import Fabric


def fabric_card(fabric: Fabric, role: str) -> dict[str, Any]:
    """Return the title, weave, source and yarns of a fabric as text, and the colours of the yarns."""
    ends, picks = fabric.weave.repeat
    yarns = []
    average = fabric.average()
    for family, yarn in (("warp", average.warp), ("weft", average.weft)):
        numbers = [
            f"{yarn.bend:.3g}°",
            f"{yarn.twist:.3g}°".replace("-", "−"),
            f"{yarn.roughness:.3g}",
            f"{yarn.relief:.3g}",
            f"{yarn.width:.3g}",
        ]
        colours = [hex_colour([EXPOSURE * c for c in rgb]) for rgb in (yarn.diffuse_rgb, yarn.specular_rgb)]
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
