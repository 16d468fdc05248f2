import numpy as np
import pytest
import torch

from pipeline.models.unified_btf import UnifiedBtfOptions
from pipeline.models.unified_btf.set_encoder import SetEncoder, Texels, angles_of, read_texels, texels_of
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.shards.store import rows_of
from weaves.fabric import load_fabric

OPTIONS = UnifiedBtfOptions(encoder_hidden=16, weights=8)
SMALL = UnifiedBtfOptions(texels_per_yarn=2, samples=4, fewest_samples=2)
SHANTUNG, LINING = load_fabric("silk_shantung"), load_fabric("polyester_lining")


def made_up(count: int, seed: int = 0) -> Texels:
    """Return smooth, positive samples of six texels that differ, without asking the truth."""
    drawn = draw_queries(QueryOptions(), (1, 1), seed, 0, count)
    phase = np.arange(24).reshape(6, 4)
    wave = 2.0 * drawn.wi[:, 0] + drawn.wo[:, 1] - drawn.wi[:, 2] * drawn.wo[:, 0]
    angles = angles_of(torch.from_numpy(drawn.wi), torch.from_numpy(drawn.wo), OPTIONS.angles)
    values = 0.1 * (1.1 + np.sin(wave[:, None, None] + phase))
    return Texels((1, 6), angles, torch.from_numpy(values.astype(np.float16)))


def encoder() -> SetEncoder:
    torch.manual_seed(0)
    built = SetEncoder(OPTIONS)
    built.scale.fill_(10.0)
    return built


def encoded(model: SetEncoder, samples: Texels, chosen: np.ndarray | slice = slice(None)) -> torch.Tensor:
    latents: torch.Tensor = model(samples.angles[chosen], samples.values[chosen].to(torch.float32))
    return latents


def test_rows_become_samples_by_texels_and_those_in_use_are_not_computed_again():
    wi, wo = torch.tensor([0.6, 0.0, 0.8]), torch.tensor([0.0, -0.8, 0.6])
    torch.testing.assert_close(angles_of(wi, wo, "disc"), torch.tensor([0.6, 0.0, 0.0, -0.8]))
    torch.testing.assert_close(angles_of(wi, wo, "stereographic"), torch.tensor([1 / 3, 0.0, 0.0, -0.5]))
    # A 6 x 8 repeat, so that no mistake of order can hide; half precision rounds by 2^-11.
    columns = SMALL.angular_samples.answer(SHANTUNG, 0, SMALL.angular_samples.count(SHANTUNG))
    queries, answers = rows_of(columns)
    samples = read_texels(SHANTUNG, SMALL, columns)
    assert samples.shape == (2 * SHANTUNG.weave.repeat[1], 2 * SHANTUNG.weave.repeat[0])
    sample, row, column = 2, 3, 9
    angles = angles_of(torch.from_numpy(queries.wi), torch.from_numpy(queries.wo), SMALL.angles)
    alike = (angles == samples.angles[sample]).all(dim=1).numpy()
    (found,) = np.flatnonzero((queries.u == column / 2 + 0.25) & (queries.v == row / 2 + 0.25) & alike)
    read = samples.values[sample, row * samples.shape[1] + column]
    np.testing.assert_allclose(read, answers.mean[found], rtol=2**-11, atol=2**-24)
    held = texels_of(LINING, SMALL)
    assert texels_of(LINING.model_copy(update={"name": "other"}), SMALL) is held
    assert texels_of(LINING, SMALL.model_copy(update={"latent": 4})) is held
    assert texels_of(LINING, SMALL.model_copy(update={"max_angle": 60.0})) is not held


@torch.inference_mode()
def test_order_and_number_of_the_samples_do_not_matter():
    """Every sample given thrice says nothing new; only the rounding of the sums may differ."""
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
    together = Texels((1, 1), samples.angles, values)
    for offset in (10.0, -10.0):
        model.join.bias.fill_(offset)
        expected = encoded(model, together)[0]
        torch.testing.assert_close(encoded(model, samples).mean(dim=0), expected, rtol=1e-5, atol=1e-5)
        assert (expected > 0).all() == (offset > 0)
