import math

import numpy as np
import pytest
import torch

from pipeline.fingerprint import fingerprint
from pipeline.models.domain import Domain
from pipeline.models.network import Batch, NetworkMethod
from pipeline.models.unified_btf import UnifiedBtfOptions
from pipeline.models.unified_btf.model import UnifiedBtfNetwork, averaged, build, decoder, restore
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import load_fabric

SMALL = UnifiedBtfOptions(texels_per_yarn=2, samples=8, fewest_samples=4, encoder_hidden=16, weights=8, hidden=16)
LINING, BASKET = load_fabric("polyester_lining"), load_fabric("basket")


def network(seed: int = 0, **changes: object) -> UnifiedBtfNetwork:
    torch.manual_seed(seed)
    built = UnifiedBtfNetwork(SMALL.model_copy(update=changes)).eval()
    built.encoder.scale.fill_(10.0)
    return built


def trainable(**changes: object) -> UnifiedBtfNetwork:
    """Return an untrained network with the samples of the lining."""
    options = SMALL.model_copy(update=changes)
    wanted = options.angular_samples
    return build(options, [LINING], [wanted.answer(LINING, 0, wanted.count(LINING))])


def batch_of(queries: Queries, target: torch.Tensor) -> Batch:
    columns = {name: torch.from_numpy(np.array(column)).unsqueeze(0) for name, column in queries._asdict().items()}
    transparency = torch.zeros(1, len(queries.u))
    return Batch(fabric=torch.tensor([0]), target=target.unsqueeze(0), transparency=transparency, **columns)


@pytest.mark.parametrize(("latent", "published"), [(32, 38_269), (8, 35_725)])
def test_decoder_has_the_published_weights(latent, published):
    """With RGB out: Rainer et al. 2020 and 2019."""
    assert sum(weight.numel() for weight in decoder(latent, 106, outputs=3).parameters()) == published


def test_pyramid_is_averaged_down_to_one_texel():
    latents = torch.rand(6, 10, 3)
    pyramid = averaged(latents)
    assert [tuple(level.shape) for level in pyramid] == [(3, 6, 10), (3, 3, 5), (3, 2, 3), (3, 1, 2), (3, 1, 1)]
    torch.testing.assert_close(pyramid[1][:, 0, 0], latents[:2, :2].mean(dim=(0, 1)))
    torch.testing.assert_close(pyramid[-1][:, 0, 0], latents.mean(dim=(0, 1)))


def test_footprint_chooses_the_level():
    """A texel's own footprint reads level 0, twice it level 1, a huge one the mean of all."""
    model = network(texel_sigma=1.0)
    pyramid = [torch.full((1, size, size), float(index)) for index, size in enumerate((4, 2, 1))]
    sigma = torch.tensor([1e-3, 0.5, 0.5 * math.sqrt(2), 1.0, 1e3])
    found = model.read(pyramid, torch.zeros(5), torch.zeros(5), sigma)[:, 0]
    torch.testing.assert_close(found, torch.tensor([0.0, 0.0, 0.5, 1.0, 2.0]))


def test_place_chooses_the_texel():
    model = network()
    latents = torch.arange(4.0 * 6).reshape(4, 6, 1)
    centre_of_row_1_column_4 = torch.tensor([4.5 / 6]), torch.tensor([1.5 / 4])
    found = model.read(averaged(latents), *centre_of_row_1_column_4, torch.tensor([1e-3]))
    assert found.item() == pytest.approx(latents[1, 4, 0].item())


def test_it_learns_what_differs_from_place_to_place():
    """A target that follows which yarn of a plain weave is on top: four fifths of its variance are explained."""
    model = trainable(texels_per_yarn=4).train()
    queries = draw_queries(QueryOptions(sigma=(0.1, 0.1)), LINING.weave.repeat, 3, 0, 256)
    warp = torch.from_numpy(np.sin(np.pi * queries.u) * np.sin(np.pi * queries.v))
    target = (0.1 + 0.05 * warp).unsqueeze(-1).expand(-1, 4).contiguous()
    model.start_at(target)
    batch = batch_of(queries, target)
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-2)
    losses = []
    for step in range(150):
        loss = model.loss(batch, np.random.default_rng(step))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert np.mean(losses[-10:]) < 0.2 * losses[0]


def test_loss_is_a_function_of_its_random_numbers():
    model = trainable()
    queries = draw_queries(QueryOptions(), LINING.weave.repeat, 3, 0, 16)
    batch = batch_of(queries, torch.rand(16, 4, generator=torch.Generator().manual_seed(0)))
    first, again, other = (model.loss(batch, np.random.default_rng(seed)).item() for seed in (1, 1, 2))
    assert first == again != other


@pytest.mark.parametrize("strange", [{"behind": 1.0}, {"stretch": 4.0}, {"curvature": (0.1, 0.2)}])
def test_rows_it_cannot_learn_are_refused(strange):
    model = trainable()
    queries = draw_queries(QueryOptions(**strange), LINING.weave.repeat, 3, 0, 4)
    with pytest.raises(BadInput, match="leave behind, stretch and curvature out"):
        model.loss(batch_of(queries, torch.zeros(4, 4)), np.random.default_rng(0))


def test_unseen_fabric_is_one_forward_pass():
    """Nothing in the network changes, and the answers differ from place to place and at no extreme go wild."""
    model = network()
    before = {name: weight.clone() for name, weight in model.state_dict().items()}
    method = NetworkMethod(model)
    assert method.covers(BASKET)
    method.prepare(BASKET)
    u, v, sigma = (a.ravel() for a in np.meshgrid([0.0, 1.3, 1e6, -1e6], [0.0, -1e-30, 2.2], [1e-4, 1.0, 1e4]))
    grazing = np.tile(np.float32([np.sin(np.radians(89.9)), 0.0, np.cos(np.radians(89.9))]), (len(u), 1))
    asked = Queries.round(*(column.astype(np.float32) for column in (u, v, sigma)), grazing, grazing)
    prediction = method.predict(BASKET, asked)
    assert prediction.shape == (len(u), 4)
    assert np.isfinite(prediction).all()
    assert (prediction >= 0).all()
    small = sigma < 1
    assert np.ptp(prediction[small], axis=0).max() > 0
    np.testing.assert_allclose(prediction[sigma > 1e3], prediction[sigma > 1e3][:1].repeat(12, 0), rtol=1e-4)
    assert all(torch.equal(before[name], weight) for name, weight in model.state_dict().items())


def test_bytes_are_those_of_latents_and_decoder():
    method = NetworkMethod(network())
    ends, picks = LINING.weave.repeat
    texels = sum((2 * ends // 2**level) * (2 * picks // 2**level) for level in range(3))
    weights = sum(weight.numel() for weight in decoder(32, 16).parameters())
    assert (ends, picks) == (2, 2)
    assert method.bytes_stored(LINING) == 4 * (32 * texels + weights)


def card_of(**physics: object) -> dict[str, object]:
    domain = Domain.of({"truth": physics, "queries": {"behind": 0.5}}, [LINING])
    fabric = {"name": LINING.name, "optics": fingerprint(LINING.optics()), "repeat": [2, 2]}
    return {"fabrics": [fabric], "domain": domain.model_dump(mode="json")}


def test_restored_method_answers_alike_and_only_what_it_knows():
    model = network()
    (method,) = restore(SMALL, [(card_of(), model.state_dict())])
    queries = draw_queries(QueryOptions(), (2, 2), 5, 0, 32)
    np.testing.assert_array_equal(method.predict(LINING, queries), NetworkMethod(model).predict(LINING, queries))
    with pytest.raises(BadInput, match="light from the viewer's side"):
        method.predict(LINING, draw_queries(QueryOptions(behind=1.0), (2, 2), 5, 0, 4))


def test_samples_of_other_physics_are_refused():
    with pytest.raises(BadInput, match="footprint"):
        restore(SMALL, [(card_of(footprint="box"), network().state_dict())])
