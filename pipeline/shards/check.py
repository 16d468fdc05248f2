"""Check shards against their manifest: hashes, schema, ranges, finite values."""

from pathlib import Path

import numpy as np
import pyarrow.compute as pc

from pipeline.fingerprint import file_sha256
from pipeline.shards.manifest import Manifest, ShardEntry
from pipeline.shards.schema import BOUNDS, SCHEMAS, STANDARD_ERRORS
from pipeline.shards.store import read_table
from pipeline.truth.conventions import COMPONENTS, TRANSPARENCY
from pipeline.truth.query import STEEPEST_CURVATURE
from weaves.errors import BadInput

_UNIT_TOLERANCE = 1e-5


def check_shard(folder: Path, entry: ShardEntry, manifest: Manifest) -> list[str]:
    """Return every fault of one shard as a sentence; an empty list means it is sound."""
    path = folder / entry.file
    if not path.exists():
        return [f"{path}: does not exist; run `twillight generate`"]
    faults = []
    if file_sha256(path) != entry.sha256:
        faults.append(f"{path}: its bytes are not those that were written (SHA-256 differs); delete it and generate")
    return faults + check_values(path, entry, manifest.fabrics[entry.fabric].weave.repeat)


def check_values(path: Path, entry: ShardEntry, repeat: tuple[int, int]) -> list[str]:
    """Return every fault of a shard's rows as a sentence: schema, number, ranges; `repeat` is its fabric's."""
    faults = []
    try:
        table = read_table(path, entry.kind)
    except BadInput as error:
        return [str(error)]
    if table.num_rows != entry.rows:
        faults.append(f"{path}: holds {table.num_rows} rows, the manifest says {entry.rows}")
    if pc.unique(table.column("fabric")).to_pylist() != [entry.fabric]:
        faults.append(f"{path}: column fabric holds other names than {entry.fabric!r}")

    # Values: finite, within their ranges, directions of unit length.
    column = {name: table.column(name).to_numpy() for name in SCHEMAS[entry.kind].names[1:]}
    ranges = {"u": (0.0, float(repeat[0])), "v": (0.0, float(repeat[1])), "count": (1, np.inf)}
    ranges |= {"angle": (-np.inf, np.inf), "curvature": (0.0, STEEPEST_CURVATURE)}
    ranges |= {TRANSPARENCY: (0.0, 1.0), "opacity": (0.0, 1.0)}
    positive = ("sigma", "sigma_minor", "opacity_standard_error", "grazing_mean", "grazing_variance")
    through = f"{TRANSPARENCY}_standard_error", f"{TRANSPARENCY}_bound"
    ranges |= dict.fromkeys((*positive, *COMPONENTS, *STANDARD_ERRORS, *BOUNDS, *through), (0.0, np.inf))
    for name, values in column.items():
        low, high = ranges.get(name, (-1.0, 1.0))
        if not np.isfinite(values).all():
            faults.append(f"{path}: column {name} holds values that are not finite")
        elif values.size and (values.min() < low or values.max() > high):
            faults.append(f"{path}: column {name} spans [{values.min()}, {values.max()}], allowed [{low}, {high}]")
    for prefix in (prefix for prefix in ("wi", "wo") if f"{prefix}_x" in column):
        length = np.sqrt(sum(column[f"{prefix}_{axis}"].astype(np.float64) ** 2 for axis in "xyz"))
        if length.size and np.abs(length - 1).max() > _UNIT_TOLERANCE:
            faults.append(f"{path}: {prefix} is off unit length by {np.abs(length - 1).max():.1e}")
    return faults
