"""Requirements of a scene: the narrowest distribution that contains its queries.

The queries of all frames are collected. The range of each quantity lies between its `_RARE` quantiles and is widened by
a margin: footprints and curvatures by a factor, angles by degrees. Kinds that do not occur are left out: light from
behind, curved cloth, stretched footprints. Queries outside the distribution fall back (`pipeline.models.fallback`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from pydantic import Field

from pipeline.compiled.arrays import Float32
from pipeline.shards.queries import QueryOptions
from pipeline.truth.query import STEEPEST_CURVATURE, Queries
from weaves.errors import BadInput
from weaves.validation import Frozen

_RARE = 5e-4  # share of the queries beyond either end of a range
_ROUND = 1.05  # ratio of a footprint's axes up to which it counts as round
_STEEPEST = 89.0  # degrees: the truth knows no lower viewers, what lies beyond falls back


class Requirement(Frozen):
    """Queries of a scene, summarised."""

    scene: str
    """Name of the scene."""
    frames: int = Field(ge=1)
    """Frames that were analysed."""
    queries_per_frame: int = Field(ge=1)
    """Mean number of queries of a frame."""
    fabrics: dict[str, float]
    """Share of the queries on each fabric."""
    sigma: tuple[float, float]
    """Range of the root of the product of a footprint's axes, in yarn spacings."""
    stretch: float = Field(ge=1)
    """Largest ratio of a footprint's axes."""
    angle: tuple[float, float]
    """Largest angle to the normal of the light and of the viewer, in degrees."""
    curvature: tuple[float, float]
    """Range of the curvature where cloth is curved, in 1/yarn spacings; [0, 0] where none is."""
    curved: float = Field(ge=0, le=1)
    """Share of the queries on curved cloth."""
    behind: float = Field(ge=0, le=1)
    """Share of the queries with light from the other side of the cloth."""
    viewer_behind: float = Field(ge=0, le=1)
    """Share of the queries on the back of the cloth."""
    not_in_front: float = Field(ge=0, le=1)
    """Share of the queries with light or viewer behind the cloth."""
    sizes: dict[str, float]
    """Share of the queries in each class of footprints, by the names given to `of`."""

    @classmethod
    def of(
        cls,
        scene: str,
        frames: int,
        by_fabric: Mapping[str, Queries],
        edges: Sequence[float],
        names: Sequence[str],
        margin: float = 1.25,
    ) -> Requirement:
        """Return the requirements of queries.

        `edges` of the classes of footprints are in yarn spacings, `names` those of the classes. `margin` is the factor
        by which ranges of footprints and curvatures are widened at either end; angles are by that share of their
        distance to 90 degrees, at least 1 degree. BadInput if there are no queries.
        """
        counts = {name: len(queries.u) for name, queries in by_fabric.items() if len(queries.u)}
        total = sum(counts.values())
        if not total:
            raise BadInput(scene, "frames", frames, "no cloth that is lit is in sight of the camera")
        queries = Queries(*(np.concatenate([getattr(q, name) for q in by_fabric.values()]) for name in Queries._fields))
        size = np.sqrt(queries.sigma.astype(np.float64) * queries.sigma_minor)
        low, high = _range(size)
        ratio = _range(queries.sigma / queries.sigma_minor)[1]
        bent = queries.curvature[queries.curvature > 0]
        least, most = _range(bent) if bent.size else (0.0, 0.0)
        classes = np.clip(np.digitize(size, edges) - 1, 0, len(names) - 1)
        return cls(
            scene=scene,
            frames=frames,
            queries_per_frame=max(1, round(total / frames)),
            fabrics={name: count / total for name, count in counts.items()},
            sigma=(low / margin, high * margin),
            stretch=1.0 if ratio < _ROUND else ratio * margin,
            angle=(_steepest(queries.wi, margin), _steepest(queries.wo, margin)),
            curvature=(least / margin, min(most * margin, STEEPEST_CURVATURE)),
            curved=float(bent.size / total),
            behind=float((queries.wi[:, 2] * queries.wo[:, 2] < 0).mean()),
            viewer_behind=float((queries.wo[:, 2] < 0).mean()),
            not_in_front=float(queries.behind.mean()),
            sizes={name: float((classes == index).mean()) for index, name in enumerate(names)},
        )

    def queries(self, kinds: frozenset[str] = frozenset({"behind", "stretch", "curvature"})) -> QueryOptions:
        """Return the distribution to train a model of these kinds on; other kinds are left out."""
        return QueryOptions(
            sigma=self.sigma,
            max_angle=max(self.angle),
            behind=self.behind if "behind" in kinds else 0.0,
            stretch=self.stretch if "stretch" in kinds else 1.0,
            curvature=self.curvature if "curvature" in kinds and self.curved > 0 else (0.0, 0.0),
        )


def _range(values: npt.NDArray[np.floating]) -> tuple[float, float]:
    """Return the range of all but the rarest values at either end."""
    low, high = np.quantile(values.astype(np.float64), [_RARE, 1.0 - _RARE])
    return float(low), float(high)


def _steepest(directions: Float32, margin: float) -> float:
    """Return the largest angle to the normal on either side, in degrees, with its margin."""
    largest = _range(np.degrees(np.arccos(np.clip(np.abs(directions[:, 2].astype(np.float64)), 0.0, 1.0))))[1]
    room = max(1.0, (margin - 1.0) * (90.0 - largest))
    return min(largest + room, _STEEPEST)
