"""The columns of a shard of each kind: one row is one query with its answer.

Flat named columns, 32-bit floats; conventions (who is `wi`, is the cosine inside) are those of
pipeline.truth.conventions. The file's own metadata repeats the choices that shaped it, so that a shard can be
understood without this package.
"""

from __future__ import annotations

from typing import Final

import pyarrow as pa

from pipeline.shards.queries import Kind
from pipeline.truth.conventions import COMPONENTS, TRANSPARENCY

SCHEMA_VERSION: Final = 3

_QUERY: Final = {
    "u": "footprint centre along x (weft direction), yarn spacings, in [0, ends of the repeat]",
    "v": "footprint centre along y (warp direction), yarn spacings, in [0, picks of the repeat]",
    "sigma": "standard deviation of the footprint along its first axis, yarn spacings, > 0",
    "wi_x": "unit vector to the light",
    "wi_y": "unit vector to the light",
    "wi_z": "unit vector to the light; signed: below 0 the light is behind the cloth (transmission)",
    "wo_x": "unit vector to the viewer",
    "wo_y": "unit vector to the viewer",
    "wo_z": "unit vector to the viewer; signed, as wi_z",
    "sigma_minor": "standard deviation of the footprint along its second axis, yarn spacings, > 0",
    "angle": "angle from x to the footprint's first axis, radians",
    "curvature": "curvature of the cloth in the viewer's plane, 1/yarn spacings; 0 for flat cloth",
}
_ANSWER: Final = {
    "specular_warp": "S_warp, unit colour, incident cosine included, 1/sr",
    "specular_weft": "S_weft, unit colour, incident cosine included, 1/sr",
    "diffuse_warp": "C_warp, unit colour, incident cosine included, 1/sr",
    "diffuse_weft": "C_weft, unit colour, incident cosine included, 1/sr",
}
_STANDARD_ERROR: Final = "standard error of {}: on average over rows, the root mean square of its error"
_BOUND: Final = "bound of the error of {}: 997 of 1,000 errors are smaller"
_THROUGH: Final = "share of light from straight behind that reaches the viewer unscattered, in [0, 1]"

STANDARD_ERRORS: Final = tuple(f"{name}_standard_error" for name in COMPONENTS)
BOUNDS: Final = tuple(f"{name}_bound" for name in COMPONENTS)
QUERY_COLUMNS: Final = tuple(_QUERY)
"""The columns of a query, as `twillight evaluate` reads them."""


def _field(name: str, kind: pa.DataType, meaning: str) -> pa.Field:
    return pa.field(name, kind, nullable=False, metadata={"meaning": meaning})


SCHEMA: Final = pa.schema(
    [
        _field("fabric", pa.dictionary(pa.int32(), pa.string()), "name of the fabric in the manifest"),
        *(_field(name, pa.float32(), meaning) for name, meaning in _QUERY.items()),
        *(_field(name, pa.float32(), _ANSWER[name]) for name in COMPONENTS),
        *(_field(name, pa.float32(), _STANDARD_ERROR.format(name[:-15])) for name in STANDARD_ERRORS),
        *(_field(name, pa.float32(), _BOUND.format(name[:-6])) for name in BOUNDS),
        _field(TRANSPARENCY, pa.float32(), _THROUGH),
        _field(f"{TRANSPARENCY}_standard_error", pa.float32(), _STANDARD_ERROR.format(TRANSPARENCY)),
        _field(f"{TRANSPARENCY}_bound", pa.float32(), _BOUND.format(TRANSPARENCY)),
        _field("count", pa.int32(), "points evaluated for this row"),
    ]
)
"""Arrow schema of a query with its components, each column with its meaning."""

_VIEW: Final = {
    "u": _QUERY["u"],
    "v": _QUERY["v"],
    "sigma": "standard deviation of the round footprint, yarn spacings, > 0",
    **{f"wo_{axis}": "unit vector to the viewer" for axis in "xyz"},
    "curvature": "curvature of the cloth in the viewer's plane, 1/yarn spacings, > 0",
}
_OPACITY: Final = {
    "opacity": "share of the camera rays that hit a yarn before they leave the cloth's boundary, in [0, 1]",
    "opacity_standard_error": "standard error of opacity",
}
_GRAZING: Final = {
    "grazing_mean": "mean over the footprint of the cosine at which a ray just touches, over the root of the curvature",
    "grazing_variance": "variance over the footprint of the same",
}


def _silhouette(answer: dict[str, str]) -> pa.Schema:
    columns = {**_VIEW, **answer}
    return pa.schema([SCHEMA.field("fabric"), *(_field(name, pa.float32(), columns[name]) for name in columns)])


SCHEMAS: Final[dict[Kind, pa.Schema]] = {
    "components": SCHEMA,
    "angular_samples": SCHEMA,
    "opacity": _silhouette(_OPACITY),
    "grazing_cosine": _silhouette(_GRAZING),
}
"""Arrow schema of every kind of rows."""
