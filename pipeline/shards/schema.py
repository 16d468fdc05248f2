"""The columns of a shard of each kind: one row is one query with its answer.

Flat named columns, 32-bit floats; conventions (who is `wi`, is the cosine inside) are those of
pipeline.truth.conventions. The file's own metadata repeats the choices that shaped it, so that a shard can be
understood without this package.
"""

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
_STANDARD_ERROR: Final = "standard error of {}: on average over rows, the root mean square of its error"
_BOUND: Final = "bound of the error of {}: 997 of 1,000 errors are smaller"
_SYMBOLS: Final = ("S_warp", "S_weft", "C_warp", "C_weft")
_THROUGH: Final = "share of light from straight behind that reaches the viewer unscattered, in [0, 1]"

STANDARD_ERRORS: Final = tuple(f"{name}_standard_error" for name in COMPONENTS)
BOUNDS: Final = tuple(f"{name}_bound" for name in COMPONENTS)
QUERY_COLUMNS: Final = tuple(_QUERY)  # the columns of a query, as `twillight evaluate` reads them


def _field(name: str, meaning: str, kind: pa.DataType = pa.float32()) -> pa.Field:  # noqa: B008, types are fixed
    return pa.field(name, kind, nullable=False, metadata={"meaning": meaning})


_FABRIC: Final = _field("fabric", "name of the fabric in the manifest", pa.dictionary(pa.int32(), pa.string()))
_ANSWER: Final = {
    **{name: f"{_SYMBOLS[i]}, unit colour, incident cosine included, 1/sr" for i, name in enumerate(COMPONENTS)},
    **{error: _STANDARD_ERROR.format(name) for error, name in zip(STANDARD_ERRORS, COMPONENTS, strict=True)},
    **{bound: _BOUND.format(name) for bound, name in zip(BOUNDS, COMPONENTS, strict=True)},
    TRANSPARENCY: _THROUGH,
    f"{TRANSPARENCY}_standard_error": _STANDARD_ERROR.format(TRANSPARENCY),
    f"{TRANSPARENCY}_bound": _BOUND.format(TRANSPARENCY),
}
_COUNT: Final = _field("count", "points evaluated for this row", pa.int32())

SCHEMA: Final = pa.schema([_FABRIC, *(_field(*column) for column in (_QUERY | _ANSWER).items()), _COUNT])
"""Arrow schema of a query with its components, each column with its meaning."""

_VIEW: Final = {
    "u": _QUERY["u"],
    "v": _QUERY["v"],
    "sigma": "standard deviation of the round footprint, yarn spacings, > 0",
    **{f"wo_{axis}": "unit vector to the viewer" for axis in "xyz"},
    "curvature": "curvature of the cloth in the viewer's plane, 1/yarn spacings, > 0",
}


def _silhouette(**answer: str) -> pa.Schema:
    return pa.schema([_FABRIC, *(_field(*column) for column in (_VIEW | answer).items())])


SCHEMAS: Final[dict[Kind, pa.Schema]] = {
    "components": SCHEMA,
    "angular_samples": SCHEMA,
    "opacity": _silhouette(
        opacity="share of the camera rays that hit a yarn before they leave the cloth's boundary, in [0, 1]",
        opacity_standard_error="standard error of opacity",
    ),
    "grazing_cosine": _silhouette(
        grazing_mean="mean over the footprint of the cosine at which a ray just touches, "
        "over the root of the curvature",
        grazing_variance="variance over the footprint of the same",
    ),
}
"""Arrow schema of every kind of rows."""
