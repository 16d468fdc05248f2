import re
import subprocess
import sys
from pathlib import Path

import numpy as np

from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Answers
from tests.datasets import write_dataset

README = Path(__file__).parents[3] / "pipeline" / "shards" / "README.md"


def test_the_script_reads_a_shard_without_this_package(tmp_path):
    (script,) = re.findall(r"^```python\n(.*?)^```$", README.read_text(encoding="utf-8"), re.M | re.S)
    (tmp_path / "read_shard.py").write_text(script, encoding="utf-8")
    mean = np.random.default_rng(1).random((50, 4), np.float32)
    answers = Answers.opaque(mean, mean, np.ones(50, np.int32))
    rows = "denim", "test", 0, draw_queries(QueryOptions(), (4, 4), 1, 0, 50), answers
    write_dataset(tmp_path / "data", {"seen": ["denim"]}, [rows])
    asked = [sys.executable, "-I", "read_shard.py", "data", "denim", "test"]
    done = subprocess.run(asked, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    head, _, rest = done.stdout.partition("mean [")
    assert head == "data/denim-test-0.parquet 50 rows, "
    means = [float(number) for number in rest.partition("]")[0].split()]
    np.testing.assert_allclose(means, mean.mean(axis=0), atol=1e-4)
