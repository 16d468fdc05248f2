"""The script of pipeline/shards/README.md, run on a data set of one shard in a process that knows nothing of us."""

import re
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq

from pipeline.fingerprint import file_sha256
from pipeline.shards.generate import ShardTask, generate_shard
from pipeline.shards.manifest import FILE, Manifest, ShardEntry
from pipeline.truth.options import TruthOptions
from weaves.fabric import load_fabric

README = Path(__file__).parents[3] / "pipeline" / "shards" / "README.md"


def test_the_script_reads_a_shard_without_this_package(tmp_path):
    (script,) = re.findall(r"^```python\n(.*?)^```$", README.read_text(encoding="utf-8"), re.M | re.S)
    (tmp_path / "read_shard.py").write_text(script, encoding="utf-8")
    truth, fabric = TruthOptions(estimator="owen", relative_error=1.0, max_count=256), load_fabric("denim")
    shard = tmp_path / "data" / "part.parquet"
    generate_shard(ShardTask(fabric=fabric, split="test", start=0, rows=50, seed=1, truth=truth), shard)
    digest = file_sha256(shard)
    entry = ShardEntry(file=shard.name, fabric="denim", split="test", start=0, rows=50, sha256=digest)
    facts = {"name": "tiny", "fingerprint": "0123456789abcdef", "roles": {"seen": ["denim"]}, "about": {}}
    manifest = Manifest(fabrics={"denim": fabric}, shards=[entry], **facts)
    (shard.parent / FILE).write_text(manifest.model_dump_json(), encoding="utf-8")

    asked = [sys.executable, "-I", "read_shard.py", "data", "denim", "test"]
    done = subprocess.run(asked, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("data/part.parquet 50 rows, mean [")
    means = [float(number) for number in re.findall(r"[\d.e-]+", done.stdout.partition("mean [")[2].partition("]")[0])]
    table = pq.read_table(shard)
    names = ("specular_warp", "specular_weft", "diffuse_warp", "diffuse_weft")
    assert all(abs(mean - table[name].to_numpy().mean()) < 1e-4 for mean, name in zip(means, names, strict=True))
