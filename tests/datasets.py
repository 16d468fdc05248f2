"""Data sets of rows that a test states."""

from pipeline.fingerprint import file_sha256
from pipeline.shards.manifest import Manifest, ShardEntry
from pipeline.shards.store import columns_of, write_columns
from weaves.fabric import load_fabric


def write_dataset(folder, roles, parts, name="tiny"):
    """Write rows, each part a fabric's name, a split, the first row's index, queries and answers; and the manifest."""
    folder.mkdir(parents=True, exist_ok=True)
    shards = []
    for fabric, split, start, queries, answers in parts:
        path, rows = folder / f"{fabric}-{split}-{start}.parquet", len(queries.u)
        write_columns(path, "components", fabric, columns_of(queries, answers), {})
        facts = {"fabric": fabric, "split": split, "start": start, "rows": rows, "sha256": file_sha256(path)}
        shards.append(ShardEntry(file=path.name, **facts))
    fabrics = {fabric: load_fabric(fabric) for names in roles.values() for fabric in names}
    Manifest(name=name, fingerprint="0", roles=roles, fabrics=fabrics, about={}, shards=shards).save(folder)
