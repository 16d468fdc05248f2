"""The head of RGB, and materials of measured samples."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch

from pipeline.models.named import named_method
from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.models.registry import load_model
from pipeline.models.unified_btf.encode import FABRIC_FILE, encode
from pipeline.models.unified_btf.model import RgbBtfNetwork, angles_of, averaged
from pipeline.scenes.bounces import later_bounces
from pipeline.shards.entry_files import RGB_COLUMNS
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from tests.pipeline.models.rgb_samples import COLUMNS, RGB, ROWS, measured, network, write_trained
from tests.pipeline.models.stand_ins import batch_of, untrained
from tests.refusals import refusal
from weaves.fabric import load_fabric

LINING = load_fabric("polyester_lining")


@torch.inference_mode()
def test_the_decoder_has_the_published_weights_and_components_are_answered_as_colours():
    wide = RGB.model_copy(update={"hidden": 106, "latent": 32})
    assert RgbBtfNetwork(wide).counts()["decoder"] == 38_269
    assert "random colours" in wide.departures[0]
    model, random = network(), torch.Generator().manual_seed(0)
    angles, values = torch.rand(5, 4, generator=random), torch.rand(5, 3, 4, generator=random)
    answers = model.answers(model.latents(angles, values), angles[0].expand(3, -1))
    for paint, columns in ((torch.eye(4, 3), answers[:, :3]), (torch.eye(4)[:, 3:].expand(-1, 3), answers[:, 3:])):
        seen = model.to_rgb(model.encoder(angles, values @ paint), angles[0].expand(3, -1))
        torch.testing.assert_close(columns, seen if columns.shape[1] == 3 else seen.mean(dim=1, keepdim=True))


@torch.inference_mode()
def test_rows_are_encoded_as_a_table_of_them_whatever_their_order():
    samples, pair = measured()
    encoder, texels = network().encoder, ROWS * COLUMNS
    values, angles = torch.empty(8, texels, 3), torch.empty(8, 4)
    of_rows = angles_of(torch.from_numpy(samples.wi), torch.from_numpy(samples.wo))
    values[pair, samples.texel], angles[pair] = torch.from_numpy(samples.rgb), of_rows
    rows = torch.from_numpy(samples.texel), of_rows, torch.from_numpy(samples.rgb)
    torch.testing.assert_close(encoder.of_rows(*rows, texels), encoder(angles, values), rtol=1e-5, atol=1e-6)


def test_the_loss_is_that_of_fabrics_in_colours_of_their_own():
    """By hand, for two fabrics in random colours that the step names."""
    fabrics = [LINING, load_fabric("basket")]
    model = untrained(RGB, *fabrics).eval()
    queries = [draw_queries(QueryOptions(sigma=(0.2, 0.5)), f.weave.repeat, 3, 0, 8) for f in fabrics]
    batches = [batch_of(q, torch.rand(8, 4), index) for index, q in enumerate(queries)]
    batch = type(batches[0])(*(torch.cat(columns) for columns in zip(*batches, strict=True)))
    random = np.random.default_rng(4)
    paints = torch.from_numpy((random.random((2, 4, 3)) * (random.random((2, 4, 3)) < 0.5)).astype(np.float32))
    errors = []
    for index, (own, paint) in enumerate(zip(queries, paints, strict=True)):
        pyramid = averaged(model.latents_of(index, random, paint))
        ends, picks = fabrics[index].weave.repeat
        u, v, sigma = (torch.from_numpy(x) for x in (own.u / ends, own.v / picks, own.sigma))
        angles = angles_of(torch.from_numpy(own.wi), torch.from_numpy(own.wo))
        output = model.decode(model.read(pyramid, u, v, sigma), angles)
        rgb = torch.stack([sum(batch.target[index, :, c] * paint[c, x] for c in range(4)) for x in range(3)], dim=-1)
        errors.append((output - torch.log1p(3.0 * rgb)).square())
    expected = torch.cat(errors).mean()
    torch.testing.assert_close(model.loss(batch, np.random.default_rng(4)), expected)


def write_table(path, samples):
    """Write samples as a table, places anywhere in their texels."""
    random = np.random.default_rng(0)
    row, column = np.divmod(samples.texel, COLUMNS)
    columns = {"u": (column + random.random(len(row))) / COLUMNS, "v": (row + random.random(len(row))) / ROWS}
    columns |= {f"{name}_{axis}": getattr(samples, name)[:, i] for name in ("wi", "wo") for i, axis in enumerate("xyz")}
    columns |= dict(zip(RGB_COLUMNS, samples.rgb.T, strict=True))
    pq.write_table(pa.table({name: np.ascontiguousarray(values) for name, values in columns.items()}), path)
    return path


def test_measured_samples_become_a_material_that_renderers_use(tmp_path):
    (samples, _), trained = measured(), write_trained(tmp_path / "rgb")
    table, texels = write_table(tmp_path / "s.parquet", samples), (COLUMNS, ROWS)
    encode(table, texels, trained, "linen", (60.0, 4.0), tmp_path / "linen")
    (method,) = load_model(tmp_path / "linen")
    fabric = load_fabric(tmp_path / "linen" / FABRIC_FILE)
    assert method.covers(fabric) and not method.covers(LINING)
    # The repeat is the patch of 60 by 4 mm: 16 yarns of 3.75 mm and 4 of 1 mm.
    assert fabric.repeat == (16, 4) and fabric.yarns_per_cm == pytest.approx((10 / 3.75, 10.0))
    queries = draw_queries(QueryOptions(sigma=(0.3, 3.0), max_angle=70.0), (32, 8), 4, 0, 50)
    answers = method.predict(fabric, queries)

    # The same by hand, of 24 texels over 240 square millimetres.
    model = network()
    with torch.inference_mode():
        texel, wi, wo, rgb = map(torch.from_numpy, (samples.texel, samples.wi, samples.wo, samples.rgb))
        latents = model.encoder.of_rows(texel, angles_of(wi, wo), rgb, ROWS * COLUMNS).reshape(ROWS, COLUMNS, -1)
        sigma_in_texels = torch.from_numpy(queries.sigma) * (3.75 * 1.0) ** 0.5 * (24 / 240) ** 0.5
        place = torch.from_numpy(queries.u) % 16 / 16, torch.from_numpy(queries.v) % 4 / 4
        read = model.read(averaged(latents), *place, sigma_in_texels / RGB.texels_per_yarn)
        expected = model.to_rgb(read, angles_of(torch.from_numpy(queries.wi), torch.from_numpy(queries.wo)))
    np.testing.assert_allclose(answers[:, :3], expected, rtol=1e-4, atol=1e-6)
    assert not answers[:, 3].any() and answers.std(axis=0)[:3].min() > 1e-4
    assert not method.predict(fabric, queries._replace(wi=queries.wi * [1, 1, -1])).any()

    # Renderers show these colours alone: no light between yarns, none through them, from the back as from the front.
    answerer = named_method(str(tmp_path / "linen"), "render", "--method")
    colours = answerer.colours(fabric, queries)
    np.testing.assert_array_equal(np.einsum("nc,ncx->nx", answers, colours), answers[:, :3])
    assert not later_bounces(fabric, queries, colours).any()
    bsdf = PatchBSDF(fabric, answerer)
    np.testing.assert_allclose(bsdf.eval(queries), answers[:, :3], rtol=1e-6)
    looks = Queries.round(*np.full((3, 4), 0.5, np.float32), *np.tile(np.float32([0, 0, 1]), (2, 4, 1)))
    assert np.isfinite(bsdf.sample(looks, np.full((4, 3), 0.5)).weight).all()
    curved = queries._replace(curvature=np.full(50, 0.1, np.float32))
    assert (answerer.coverage(fabric, curved, 0) == 1.0).all() and not answerer.transparency(fabric, queries, 0).any()
    np.testing.assert_allclose(answerer.predict(fabric, queries.turned(), 0), answers, rtol=1e-5, atol=1e-7)


def test_folders_and_sizes_that_cannot_be_used_are_refused(tmp_path):
    (samples, _), trained = measured(), write_trained(tmp_path / "rgb")
    table, texels, out = write_table(tmp_path / "s.parquet", samples), (COLUMNS, ROWS), tmp_path / "linen"
    for wrong in ((0.0, 4.0), (2e4, 4.0), (float("nan"), 1.0)):
        assert "from 0.1 to 1000 mm" in refusal(encode, table, texels, trained, "linen", wrong, out)
    assert "holds a trained model" in refusal(encode, table, texels, trained, "linen", (1.0, 1.0), trained)
    encode(table, texels, trained, "linen", (1.0, 1.0), out)
    encode(table, texels, trained, "linen", (2.0, 1.0), out)
    assert 'head = "rgb"' in refusal(encode, table, texels, out, "linen", (1.0, 1.0), tmp_path / "x")
