"""Order of pictures on a page: views of fabrics and scenes by every method, and strips of frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import pandas as pd

from reports.record import TRUTH
from reports.tables.number_format import beyond_noise, display, scientific
from reports.tables.summary import BASELINE, rows

MOST_FILMS: Final = 12
"""Rows of a strip of frames."""


@dataclass(frozen=True)
class PictureFile:
    """A picture that was rendered."""

    fabric: str
    """Empty for a scene, which has cloths of its own."""
    scene: str
    """View of the fabric, or name of the scene."""
    method: str
    """``truth`` for the reference."""
    setting: str
    path: Path

    @property
    def label(self) -> str:
        """Of the method with its setting."""
        return display(self.method, self.setting)

    @property
    def stem(self) -> str:
        """Of the names of its tiles."""
        words = [self.fabric or "scene", self.scene, self.method, *self.setting.replace("=", "").split()]
        return "-".join(words)


@dataclass(frozen=True)
class Strip:
    """One view of one fabric, or one scene, by every method; the truth first."""

    fabric: str
    scene: str
    role: str = ""
    cells: list[dict[str, str]] = field(default_factory=list)
    """Each with `stem`, `method`, `label` and `mse`."""


def strips(
    pictures: Sequence[PictureFile],
    order: Mapping[str, str],
    scenes: Sequence[str],
    errors: Sequence[pd.DataFrame],
) -> list[Strip]:
    """Return the views of the fabrics, then the scenes.

    Parameters
    ----------
    pictures : sequence of PictureFile
        What there is to show.
    order : mapping
        The fabrics in their order, each with its role.
    scenes : sequence of str
        Views and scenes in their order.
    errors : sequence of DataFrame
        From `summary.picture_table` and `summary.scene_table`: the MSE that stands beside a picture.
    """
    mse = {
        (getattr(row, "fabric", ""), row.scene, row.method, row.setting): row.mse
        for table in errors
        for row in rows(table)
    }
    found: dict[tuple[str, str], Strip] = {}
    for file in sorted(pictures, key=lambda file: file.method != TRUTH):
        strip = found.setdefault((file.fabric, file.scene), Strip(file.fabric, file.scene, order.get(file.fabric, "")))
        value = mse.get((file.fabric, file.scene, file.method, file.setting), math.nan)
        cell = {"stem": file.stem, "method": file.method, "label": display(file.method, file.setting)}
        strip.cells.append(cell | {"mse": beyond_noise(value, scientific)})
    fabrics, places = ({name: index for index, name in enumerate(names)} for names in (order, dict.fromkeys(scenes)))
    return sorted(found.values(), key=lambda s: (fabrics.get(s.fabric, len(fabrics)), places.get(s.scene, len(places))))


def films(pictures: Sequence[PictureFile]) -> dict[str, list[PictureFile]]:
    """Return for each scene the rows of its strip of frames: the truth, then every method once.

    Of a method with several settings the first picture counts: there it aliases most. Of more than `MOST_FILMS` the
    first ones stay, and the baseline.
    """
    result: dict[str, list[PictureFile]] = {}
    for scene in dict.fromkeys(file.scene for file in pictures if not file.fabric):
        own = sorted((f for f in pictures if not f.fabric and f.scene == scene), key=lambda f: f.method != TRUTH)
        once = list({file.method: file for file in reversed(own)}.values())[::-1]
        once.sort(key=own.index)
        rank = {file: index for index, file in enumerate(sorted(once, key=_least_wanted))}
        result[scene] = [file for file in once if rank[file] < MOST_FILMS]
    return result


def _least_wanted(file: PictureFile) -> bool:
    return file.method != TRUTH and (file.method, file.setting) != BASELINE
