"""The head of RGB, and materials of measured samples."""

import numpy as np
import torch

from pipeline.analytic.importance.lobes import STRAIGHT
from pipeline.models.named import named_method
from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.models.registry import load_model
from pipeline.models.unified_btf.encode import FABRIC_FILE, encode
from pipeline.models.unified_btf.model import RgbBtfNetwork, angles_of, averaged
from pipeline.scenes.bounces import later_bounces
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from tests.pipeline.models.rgb_samples import COLUMNS, RGB, ROWS, measured, network, write_trained
from tests.refusals import refusal
from weaves.fabric import load_fabric

LINING = load_fabric("polyester_lining")


@torch.inference_mode()
def test_the_decoder_has_the_published_weights_and_components_are_answered_as_colours():
    wide = RGB.model_copy(update={"hidden": 106, "latent": 32})
    assert RgbBtfNetwork(wide).counts()["decoder"] == 38_269
    assert not wide.departures
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


def test_measured_samples_become_a_material_that_renderers_use(tmp_path):
    (samples, _), trained = measured(), write_trained(tmp_path / "rgb")
    encode(samples, trained, "linen", (12.0, 4.0), tmp_path / "linen")
    (method,) = load_model(tmp_path / "linen")
    fabric = load_fabric(tmp_path / "linen" / FABRIC_FILE)
    assert method.covers(fabric) and not method.covers(LINING)
    queries = draw_queries(QueryOptions(sigma=(0.3, 3.0), max_angle=70.0), (24, 8), 4, 0, 50)
    answers = method.predict(fabric, queries)

    # The same by hand: a patch of 12 by 4 mm, 24 texels; one yarn spacing is a millimetre.
    model = network()
    with torch.inference_mode():
        rows = map(torch.from_numpy, (samples.texel, samples.wi, samples.wo, samples.rgb))
        texel, wi, wo, rgb = rows
        latents = model.encoder.of_rows(texel, angles_of(wi, wo), rgb, ROWS * COLUMNS).reshape(ROWS, COLUMNS, -1)
        sigma_in_texels = torch.from_numpy(queries.sigma) * (24 / 48) ** 0.5
        place = torch.from_numpy(queries.u) % 12 / 12, torch.from_numpy(queries.v) % 4 / 4
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
    assert (
        np.isfinite(bsdf.sample(looks, np.full((4, 3), 0.5)).weight).all() and bsdf.lobes(looks).rest[0, STRAIGHT] >= 0
    )
    curved = queries._replace(curvature=np.full(50, 0.1, np.float32))
    assert (answerer.coverage(fabric, curved, 0) == 1.0).all() and not answerer.transparency(fabric, queries, 0).any()
    turned = queries._replace(wi=-queries.wi, wo=-queries.wo)
    assert answerer.predict(fabric, turned, 0).any()
    for wrong, said in (((0.0, 4.0), "above 0"), ((2e4, 4.0), "10000 mm")):
        assert said in refusal(encode, samples, trained, "linen", wrong, tmp_path / "x")
    assert 'head = "rgb"' in refusal(encode, samples, tmp_path / "linen", "linen", (1.0, 1.0), tmp_path / "x")
