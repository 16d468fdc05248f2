import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from pipeline.models.registry import load_model
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.options import SceneOptions
from pipeline.shards.entry_files import RGB_COLUMNS
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.shards.schema import QUERY_COLUMNS
from pipeline.shards.store import columns_of
from tests.pipeline.models.rgb_samples import COLUMNS, ROWS, measured, write_trained
from tests.pipeline.models.unified_btf.test_rgb import write_table
from weaves.fabric import load_fabric


def test_verbs_encode_samples_evaluate_the_material_and_show_all_of_it(twillight, refused, tmp_path):
    (samples, _), trained = measured(), write_trained(tmp_path / "rgb")
    write_table("samples.parquet", samples)
    command = ["encode", "samples.parquet", "--texels", f"{COLUMNS}x{ROWS}", "--size", "60x4", "--out", "linen"]
    code, text, complaint = twillight(*command, "--model", str(trained))
    assert (code, complaint) == (0, "") and "--fabric ./linen/fabric.toml --method ./linen" in text
    (method,), fabric = load_model(tmp_path / "linen"), load_fabric("linen/fabric.toml")

    # Places far off, in double precision, and a column of the samples beside them.
    queries = draw_queries(QueryOptions(sigma=(0.3, 3.0), max_angle=70.0), (16, 4), 4, 0, 200)
    columns = {name: columns_of(queries)[name].astype(np.float64) for name in QUERY_COLUMNS[:9]}
    pq.write_table(pa.table({**columns, "u": columns["u"] + 16.0 * 0.1}), "queries.parquet")
    evaluate = "evaluate", "linen/fabric.toml", "queries.parquet", "--model", "linen", "--out", "a.parquet"
    assert twillight(*evaluate)[0] == 0
    answers = pq.read_table("a.parquet")
    rgb = np.column_stack([answers[name] for name in RGB_COLUMNS])
    moved = queries._replace(u=np.float32((columns["u"] + 1.6) % 16.0))
    np.testing.assert_allclose(rgb, method.predict(fabric, moved)[:, :3], rtol=1e-3, atol=1e-5)
    assert not {"specular_warp", "count"} & set(answers.column_names)
    pq.write_table(pa.table({**columns, "red": columns["u"]}), "queries.parquet")
    assert "column = 'red'" in refused(*evaluate)

    # A picture has the colours of the places that its pixels see.
    shown = "--fabric", "linen/fabric.toml", "--method", "linen", "--size", "24x16"
    code, text, _ = twillight("render", "plane", *shown, "--out", "l.png")
    assert code == 0 and "0% of the queries by the fallback" in text
    scene = load_scene("plane")
    cloths = {key: cloth.model_copy(update={"fabric": "linen/fabric.toml"}) for key, cloth in scene.cloths.items()}
    loaded = load(scene.model_copy(update={"cloths": cloths}), SceneOptions(environment_directions=4))
    frame = render(loaded, 0.0, (24, 16))
    ((_, gbuffer),) = frame.gbuffers.items()
    seen = gbuffer.queries(fabric.repeat)
    assert np.ptp(seen.u) > 12.0 and np.ptp(seen.v) > 3.0
