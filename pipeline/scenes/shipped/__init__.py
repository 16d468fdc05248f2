"""The scenes that come with the package, one a file; lengths in metres, the yarns larger than life."""

from __future__ import annotations

from typing import Final

from pipeline.scenes.scene import Scene
from pipeline.scenes.shipped.curtain import CURTAIN
from pipeline.scenes.shipped.dinner_table import TABLE
from pipeline.scenes.shipped.drape import DRAPE
from pipeline.scenes.shipped.plane import PLANE
from pipeline.scenes.shipped.roll import ROLL
from pipeline.scenes.shipped.sphere import SPHERE
from pipeline.scenes.shipped.swatch import SWATCH

SHIPPED: Final[dict[str, Scene]] = {
    scene.name: scene
    for scene in (
        PLANE,
        SPHERE,
        DRAPE,
        ROLL,
        CURTAIN,
        TABLE,
        SWATCH,
    )
}
"""Every shipped scene by its name."""
