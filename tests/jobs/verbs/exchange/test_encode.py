import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image

from pipeline.models.registry import load_model
from pipeline.shards.entry_files import RGB_COLUMNS
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.shards.schema import QUERY_COLUMNS
from pipeline.shards.store import columns_of
from tests.pipeline.models.rgb_samples import COLUMNS, ROWS, measured, write_trained
from weaves.fabric import load_fabric


def test_verbs_encode_samples_evaluate_the_material_and_show_it(twillight, tmp_path):
    (samples, _), trained = measured(), write_trained(tmp_path / "rgb")
    random = np.random.default_rng(0)
    row, column = np.divmod(samples.texel, COLUMNS)
    columns = {"u": (column + random.random(len(row))) / COLUMNS, "v": (row + random.random(len(row))) / ROWS}
    columns |= {f"{name}_{axis}": getattr(samples, name)[:, i] for name in ("wi", "wo") for i, axis in enumerate("xyz")}
    columns |= dict(zip(RGB_COLUMNS, samples.rgb.T, strict=True))
    pq.write_table(
        pa.table({name: np.ascontiguousarray(values) for name, values in columns.items()}), "samples.parquet"
    )
    command = ["encode", "samples.parquet", "--texels", f"{COLUMNS}x{ROWS}", "--size", "12x4", "--out", "linen"]
    code, text, complaint = twillight(*command, "--model", str(trained))
    assert (code, complaint) == (0, "") and "--fabric linen/fabric.toml --method linen" in text
    (method,) = load_model(tmp_path / "linen")
    queries = draw_queries(QueryOptions(sigma=(0.3, 3.0), max_angle=70.0), (24, 8), 4, 0, 50)
    pq.write_table(pa.table({name: columns_of(queries)[name] for name in QUERY_COLUMNS[:9]}), "queries.parquet")
    assert (
        twillight("evaluate", "linen/fabric.toml", "queries.parquet", "--model", "linen", "--out", "a.parquet")[0] == 0
    )
    answers = pq.read_table("a.parquet")
    np.testing.assert_array_equal(
        np.column_stack([answers[name] for name in RGB_COLUMNS]),
        method.predict(load_fabric("linen/fabric.toml"), queries)[:, :3],
    )
    assert not {"specular_warp", "count"} & set(answers.column_names)
    code, text, _ = twillight(
        "render", "plane", "--fabric", "linen/fabric.toml", "--method", "linen", "--size", "32x24", "--out", "l.png"
    )
    assert code == 0 and "0% of the queries by the fallback" in text
    assert np.asarray(Image.open("l.png")).std() > 1.0
