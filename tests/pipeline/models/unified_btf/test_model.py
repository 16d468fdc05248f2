import math

import numpy as np
import pytest
import torch

from pipeline.models.domain import Domain
from pipeline.models.network import NetworkMethod
from pipeline.models.unified_btf.model import UnifiedBtfNetwork, averaged, decoder, restore
from pipeline.shards.queries import QueryOptions, draw_queries
from tests.pipeline.models.stand_ins import SMALL, batch_of, card_of, descend, untrained
from weaves.errors import BadInput
from weaves.fabric import load_fabric

BTF, LINING = SMALL["unified_btf"], load_fabric("polyester_lining")


@pytest.mark.parametrize(("latent", "published"), [(32, 38_269), (8, 35_725)])
def test_decoder_has_the_published_weights(latent, published):
    """With RGB out: Rainer et al. 2020 and 2019. Bytes: levels of 4, 2 and 1 texels a side, and the decoder."""
    assert sum(weight.numel() for weight in decoder(latent, 106, outputs=3).parameters()) == published
    weights = sum(weight.numel() for weight in decoder(32, 16).parameters())
    assert NetworkMethod(UnifiedBtfNetwork(BTF)).bytes_stored(LINING) == 4 * (32 * (16 + 4 + 1) + weights)


def test_the_pyramid_is_averaged_and_read_and_what_differs_from_place_to_place_is_learnt():
    latents = torch.rand(6, 10, 3)
    pyramid = averaged(latents)
    assert [tuple(level.shape) for level in pyramid] == [(3, 6, 10), (3, 3, 5), (3, 2, 3), (3, 1, 2), (3, 1, 1)]
    torch.testing.assert_close(pyramid[1][:, 0, 0], latents[:2, :2].mean(dim=(0, 1)))
    torch.testing.assert_close(pyramid[-1][:, 0, 0], latents.mean(dim=(0, 1)))
    # A texel's own footprint reads level 0, twice it level 1, a huge one the mean of all.
    model = UnifiedBtfNetwork(BTF.model_copy(update={"texel_sigma": 1.0}))
    pyramid = [torch.full((1, size, size), float(index)) for index, size in enumerate((4, 2, 1))]
    sigma = torch.tensor([1e-3, 0.5, 0.5 * math.sqrt(2), 1.0, 1e3])
    found = model.read(pyramid, torch.zeros(5), torch.zeros(5), sigma)[:, 0]
    torch.testing.assert_close(found, torch.tensor([0.0, 0.0, 0.5, 1.0, 2.0]))
    latents = torch.arange(4.0 * 6).reshape(4, 6, 1)
    centre_of_row_1_column_4 = torch.tensor([4.5 / 6]), torch.tensor([1.5 / 4])
    found = model.read(averaged(latents), *centre_of_row_1_column_4, torch.tensor([1e-3]))
    assert found.item() == pytest.approx(latents[1, 4, 0].item())
    # A target that follows which yarn of a plain weave is on top: four fifths of its variance are explained.
    model = untrained(BTF.model_copy(update={"texels_per_yarn": 4}), LINING).train()
    queries = draw_queries(QueryOptions(sigma=(0.1, 0.1)), LINING.weave.repeat, 3, 0, 256)
    warp = torch.from_numpy(np.sin(np.pi * queries.u) * np.sin(np.pi * queries.v))
    target = (0.1 + 0.05 * warp).unsqueeze(-1).expand(-1, 4).contiguous()
    model.start_at(target)
    batch = batch_of(queries, target)
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-2)
    losses = descend(optimiser, 150, lambda step: model.loss(batch, np.random.default_rng(step)))
    assert np.mean(losses[-10:]) < 0.2 * losses[0]
    model, queries = untrained(BTF, LINING), draw_queries(QueryOptions(), LINING.weave.repeat, 3, 0, 16)
    batch = batch_of(queries, torch.rand(16, 4, generator=torch.Generator().manual_seed(0)))
    first, again, other = (model.loss(batch, np.random.default_rng(seed)).item() for seed in (1, 1, 2))
    assert first == again != other


@pytest.mark.parametrize("strange", [{"behind": 1.0}, {"stretch": 4.0}, {"curvature": (0.1, 0.2)}])
def test_rows_it_cannot_learn_are_refused(strange):
    queries = draw_queries(QueryOptions(**strange), LINING.weave.repeat, 3, 0, 4)
    with pytest.raises(BadInput, match="leave behind, stretch and curvature out"):
        untrained(BTF, LINING).loss(batch_of(queries, torch.zeros(4, 4)), np.random.default_rng(0))


@pytest.mark.parametrize(
    ("physics", "refused"), [({}, "light from the viewer's side"), ({"footprint": "box"}, "footprint")]
)
def test_samples_decide_physics_and_kinds_of_queries_whatever_the_rows_held(physics, refused):
    domain = Domain.of({"truth": physics, "queries": {"behind": 0.5}}, [LINING])
    with pytest.raises(BadInput, match=refused):
        (method,) = restore(BTF, [(card_of(LINING, domain), UnifiedBtfNetwork(BTF).state_dict())])
        method.predict(LINING, draw_queries(QueryOptions(behind=1.0), (2, 2), 5, 0, 4))
