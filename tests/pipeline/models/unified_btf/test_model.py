import math

import numpy as np
import pytest
import torch

from pipeline.models.domain import Domain
from pipeline.models.network import NetworkMethod
from pipeline.models.networks.layers import perceptron, to_components
from pipeline.models.unified_btf import UnifiedBtfOptions
from pipeline.models.unified_btf import model as btf
from pipeline.models.unified_btf.model import UnifiedBtfNetwork, averaged, restore
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.shards.store import rows_of
from tests.pipeline.models.stand_ins import SMALL, batch_of, card_of, descend, untrained
from weaves.errors import BadInput
from weaves.fabric import load_fabric

BTF, LINING = SMALL["unified_btf"], load_fabric("polyester_lining")
OPTIONS = UnifiedBtfOptions(weights=8)
FEW = UnifiedBtfOptions(texels_per_yarn=2, samples=4, fewest_samples=2)
SHANTUNG = load_fabric("silk_shantung")
RED = LINING.model_copy(update={"name": "red", "warp": LINING.warp.model_copy(update={"diffuse": (0.5, 0.1, 0.1)})})


@pytest.mark.parametrize(("latent", "published"), [(32, 38_269), (8, 35_725)])
def test_decoder_has_the_published_weights(latent, published):
    """With RGB out: Rainer et al. 2020 and 2019. Bytes: levels of 4, 2 and 1 texels a side, and the decoder."""
    assert sum(weight.numel() for weight in perceptron(latent + 4, 106, 4, 3).parameters()) == published
    network = UnifiedBtfNetwork(BTF)
    assert NetworkMethod(network).bytes_stored(LINING) == 4 * (32 * (16 + 4 + 1) + network.counts()["decoder"])


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


def test_rows_it_cannot_learn_are_refused():
    for strange in ({"behind": 1.0}, {"stretch": 4.0}, {"curvature": (0.1, 0.2)}):
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


def made_up(count: int, seed: int = 0) -> btf.Texels:
    """Return smooth, positive samples of six texels that differ, without asking the truth."""
    drawn = draw_queries(QueryOptions(), (1, 1), seed, 0, count)
    phase = np.arange(24).reshape(6, 4)
    wave = 2.0 * drawn.wi[:, 0] + drawn.wo[:, 1] - drawn.wi[:, 2] * drawn.wo[:, 0]
    angles = btf.angles_of(torch.from_numpy(drawn.wi), torch.from_numpy(drawn.wo))
    values = 0.1 * (1.1 + np.sin(wave[:, None, None] + phase))
    return btf.Texels((1, 6), angles, torch.from_numpy(values.astype(np.float16)))


def encoder() -> btf.SetEncoder:
    torch.manual_seed(0)
    built = btf.SetEncoder(OPTIONS)
    built.scale.fill_(10.0)
    return built


def encoded(model: btf.SetEncoder, samples: btf.Texels, chosen: np.ndarray | slice = slice(None)) -> torch.Tensor:
    latents: torch.Tensor = model(samples.angles[chosen], samples.values[chosen].to(torch.float32))
    return latents


@torch.inference_mode()
def test_angles_tell_light_from_viewer_but_order_and_number_of_the_samples_do_not_matter():
    """Every sample given thrice says nothing new; only the rounding of the sums may differ."""
    wi, wo = torch.tensor([0.6, 0.0, 0.8]), torch.tensor([0.0, -0.8, 0.6])
    torch.testing.assert_close(btf.angles_of(wi, wo), torch.tensor([1 / 3, 0.0, 0.0, -0.5]))
    samples, model = made_up(500), encoder()
    for chosen in (np.random.default_rng(0).permutation(500), np.tile(np.arange(500), 3)):
        torch.testing.assert_close(encoded(model, samples, chosen), encoded(model, samples), rtol=1e-4, atol=1e-6)


@torch.inference_mode()
def test_latents_converge_as_the_samples_grow():
    """The encoder averages, so 50 to 5,000 samples leave an error that falls as n^(-1/2). Expected: slope -0.5 in the
    logarithms. 64 independent sets leave about 0.02 on it; 0.1 is five deviations."""
    model = encoder()
    exact = encoded(model, made_up(200_000, seed=99))
    counts, errors = (50, 500, 5000), []
    for count in counts:
        differences = [encoded(model, made_up(count, seed=seed)) - exact for seed in range(64)]
        errors.append(float(torch.stack(differences).square().mean().sqrt()))
    slope = np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.1)
    assert errors[-1] < 0.1 * float(exact.square().mean().sqrt())


@torch.inference_mode()
def test_averaged_latents_are_the_latent_of_the_averaged_texel():
    """Exactly so where no ReLU of the latent is on its other side: all of the encoder behind it is linear in values."""
    samples, model = made_up(200), encoder()
    values = samples.values.to(torch.float32).mean(dim=1, keepdim=True)  # not rounded to half precision
    together = btf.Texels((1, 1), samples.angles, values)
    for offset in (10.0, -10.0):
        model.join.bias.fill_(offset)
        expected = encoded(model, together)[0]
        torch.testing.assert_close(encoded(model, samples).mean(dim=0), expected, rtol=1e-5, atol=1e-5)
        assert (expected > 0).all() == (offset > 0)


def test_rows_become_samples_by_texels_which_are_not_computed_again_while_in_use():
    """A 6 x 8 repeat, so that no mistake of order can hide; half precision rounds by 2^-11."""
    columns = FEW.angular_samples.answer(SHANTUNG, 0, FEW.angular_samples.count(SHANTUNG))
    queries, answers = rows_of(columns)
    samples = btf.read_texels(SHANTUNG, FEW, columns)
    assert samples.shape == (2 * SHANTUNG.weave.repeat[1], 2 * SHANTUNG.weave.repeat[0])
    sample, row, column = 2, 3, 9
    angles = btf.angles_of(torch.from_numpy(queries.wi), torch.from_numpy(queries.wo))
    alike = (angles == samples.angles[sample]).all(dim=1).numpy()
    (found,) = np.flatnonzero((queries.u == column / 2 + 0.25) & (queries.v == row / 2 + 0.25) & alike)
    read = samples.values[sample, row * samples.shape[1] + column]
    np.testing.assert_allclose(read, answers.mean[found], rtol=2**-11, atol=2**-24)
    held = btf.texels_of(LINING, FEW)
    assert btf.texels_of(LINING.model_copy(update={"name": "other"}), FEW) is held
    assert btf.texels_of(LINING, FEW.model_copy(update={"latent": 4})) is held
    assert btf.texels_of(LINING, FEW.model_copy(update={"max_angle": 60.0})) is not held


@torch.no_grad()
def test_latents_are_found_again_from_the_samples_that_they_give_and_trained_fabrics_keep_theirs():
    """Without an encoder: a descent from 0 finds most; a random network of ReLUs has minima beside."""
    options, cloths = SMALL["universal"].model_copy(update={"steps": 300, "hidden": 64}), [SHANTUNG, LINING, RED]
    torch.manual_seed(3)
    for order in (cloths, cloths[::-1]):
        network = untrained(options, *order)
        for index, cloth in enumerate(order):
            latents = network.latents_of(index, np.random.default_rng(0)).normal_()
            torch.testing.assert_close(network.encoded(cloth)[0].movedim(0, -1), latents)
    network.start_at(torch.ones(2, 4))  # no component is below 0
    angles, shares = btf.texels_of(LINING, options).angles, []
    for given in latents.flatten(0, 1)[:5, None]:
        output = network.samples(given, angles)
        found = network.fitted(btf.Texels((1, 1), angles, to_components(output, options.log_k))).flatten(0, 1)
        left, first = (network.samples(own, angles) - output for own in (found, torch.zeros_like(given)))
        shares.append(float(left.square().mean() / first.square().mean()))
    assert np.median(shares) < 1e-3
