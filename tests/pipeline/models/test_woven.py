import numpy as np
import pytest
import torch

from pipeline.models.method import Batch, Method
from pipeline.models.options import WovenOptions
from pipeline.models.woven import Woven, WovenNetwork, encoder_inputs, rolled
from pipeline.truth.query import Queries
from weaves.draft import Matrix
from weaves.fabric import load_fabric

SMALL = WovenOptions(map_texels=16, encoder_channels=4)


@pytest.fixture
def twill():
    return load_fabric("cotton_twill")


def queries(u, v, sigma, wi=(0.6, 0.0, 0.8), wo=(0.0, -0.28, 0.96)):
    u, v, sigma = (np.asarray(column, np.float32) for column in np.broadcast_arrays(u, v, sigma))
    directions = (np.tile(np.asarray(w, np.float32), (len(u), 1)) for w in (wi, wo))
    return Queries(u, v, sigma, *directions)


def test_decoder_has_the_published_number_of_parameters():
    assert WovenNetwork(WovenOptions()).architecture()["parameters"]["decoder"] == 86_660


def test_decoder_stores_the_published_bytes(twill):
    method = Woven(WovenNetwork(WovenOptions()))
    assert method.bytes_stored(twill) == 4 * (86_660 + 64)  # 0.35 MB


def test_every_way_to_enter_the_patch_has_the_published_decoder():
    for one_blob in ("plain", "periodic", "local"):
        network = WovenNetwork(WovenOptions(one_blob=one_blob, map_texels=16, encoder_channels=4))
        assert network.architecture()["parameters"]["decoder"] == 86_660


def test_fusion_can_be_left_out():
    counts = WovenNetwork(WovenOptions(one_blob="periodic", spatial_fusion=False)).architecture()["parameters"]
    layers = (64 + 24 + 5 + 1) * 128, 2 * (128 + 1) * 128, (128 + 1) * 64, (64 + 1) * 4
    assert counts["decoder"] == sum(layers)


def test_encoder_reads_unit_normals_at_the_right_place(twill):
    """Texel (row, column) is the point (u, v) = (column + 1/2, row + 1/2)/side of the repeat."""
    from weaves.surface import surface_at

    maps, parameters = encoder_inputs(twill, 32)
    ends, picks = twill.weave.repeat
    point = surface_at(twill, np.array([(5 + 0.5) / 32 * ends]), np.array([(20 + 0.5) / 32 * picks]))
    np.testing.assert_allclose(maps[:3, 20, 5], point.normal[0], atol=1e-6)
    np.testing.assert_allclose(maps[3:, 20, 5], point.tangent[0], atol=1e-6)
    expected = [twill.warp.roughness, twill.weft.roughness, twill.warp.relief, twill.weft.relief]
    np.testing.assert_allclose(parameters, expected, rtol=1e-6)


def test_rolled_maps_are_the_maps_of_the_moved_cloth(twill):
    """Roll by whole cells = roll the drawdown: what lay at (u, v) lies at (u + shift, v + shift)."""
    maps, _ = encoder_inputs(twill, 32)
    moved = rolled(torch.from_numpy(maps)[None], np.array([[8, 24]]))[0].numpy()  # columns, rows
    np.testing.assert_array_equal(moved[:, (3 + 24) % 32, (30 + 8) % 32], maps[:, 3, 30])
    np.testing.assert_array_equal(np.roll(maps, (24, 8), axis=(1, 2)), moved)
    # The twill repeats after four yarns: 24 texels of 32 are three picks, 8 are one end.
    rolled_draft = Matrix(rows=tuple(twill.weave.rolled(1, 3).rows()))
    np.testing.assert_allclose(
        encoder_inputs(twill.model_copy(update={"draft": rolled_draft}), 32)[0], moved, atol=1e-6
    )


class Fixed:
    """Stand in for a generator: symmetry 0, then a repeat begun at column and row `begin`."""

    def __init__(self, *begin):
        self.answers = [np.array([0]), np.array([begin])]

    def integers(self, bound, size=None):
        return self.answers.pop(0)


@pytest.mark.parametrize("one_blob", ["periodic", "local"])
def test_augmented_cloth_answers_alike(one_blob, twill):
    """The loss of a batch begun at another yarn is that of the fabric with its draft rolled, asked at the moved centre.

    The twill's four yarns on 16 texels: a yarn is four texels, so that rolled maps are exact.
    """
    options = SMALL.model_copy(update={"one_blob": one_blob})
    network = WovenNetwork(options, [twill])
    generator = torch.Generator().manual_seed(5)
    u, v, angle = (torch.rand(1, 8, generator=generator) for _ in range(3))
    wi = torch.stack([0.6 * angle.cos(), 0.6 * angle.sin(), torch.full_like(angle, 0.8)], dim=-1)
    target = torch.rand(1, 8, 4, generator=generator)
    batch = Batch(torch.tensor([0]), 4 * u, 4 * v, torch.full((1, 8), 0.5), wi, wi, target)
    augmented = network.loss(batch, Fixed(1, 3))

    rows = twill.weave.rolled(1, 3).rows()
    elsewhere = twill.model_copy(update={"draft": Matrix(rows=tuple(rows))})
    still = WovenNetwork(options.model_copy(update={"augment": False}), [elsewhere])
    still.load_state_dict(network.state_dict())
    moved = batch._replace(u=(4 * u + 1) % 4, v=(4 * v + 3) % 4)
    torch.testing.assert_close(still.loss(moved, np.random.default_rng(0)), augmented, rtol=1e-5, atol=1e-6)
    assert network.loss(batch, Fixed(0, 0)).item() != pytest.approx(augmented.item(), rel=1e-6)


def test_large_footprints_see_no_place(twill):
    """Far above one repeat, the `local` network answers the same wherever it is asked."""
    answers = Woven(WovenNetwork(SMALL)).predict(twill, queries([0.1, 1.7, 3.2], [2.2, 0.4, 3.9], 50.0))
    np.testing.assert_allclose(answers, np.broadcast_to(answers[:1], answers.shape), rtol=1e-5)


def test_predictions_repeat_with_the_cloth(twill):
    method = Woven(WovenNetwork(SMALL))
    ends, picks = twill.weave.repeat
    here = method.predict(twill, queries([0.25, 1.5], [0.75, 2.25], 0.3))
    there = method.predict(twill, queries([0.25 + 64 * ends, 1.5 - ends], [0.75 - 32 * picks, 2.25 + picks], 0.3))
    np.testing.assert_allclose(there, here, atol=2e-6)


def test_predictions_are_finite_and_not_negative_at_extremes(twill):
    method = Woven(WovenNetwork(SMALL))
    grazing = (np.sin(np.radians(89.9)), 0.0, np.cos(np.radians(89.9)))
    u, v, sigma = (a.ravel() for a in np.meshgrid([0.0, 4.0, 1e6, -1e6], [0.0, -1e-30, 1e6], [1e-4, 1.0, 1e4]))
    for wi, wo in ((grazing, grazing), ((0, 0, 1), grazing), (grazing, (0, 0, 1))):
        prediction = method.predict(twill, queries(u, v, sigma, wi, wo))
        assert prediction.shape == (len(u), 4)
        assert prediction.dtype == np.float32
        assert np.isfinite(prediction).all()
        assert (prediction >= 0).all()


def test_chunks_do_not_show(twill, monkeypatch):
    method = Woven(WovenNetwork(SMALL))
    assert isinstance(method, Method)
    asked = queries(np.linspace(0, 4, 37), np.linspace(0, 4, 37), 0.2)
    whole = method.predict(twill, asked)
    monkeypatch.setattr("pipeline.models.method.CHUNK", 10)
    np.testing.assert_allclose(method.predict(twill, asked), whole, atol=1e-6)


def test_no_queries_give_no_answers(twill):
    assert Woven(WovenNetwork(SMALL)).predict(twill, queries([], [], [])).shape == (0, 4)


def test_start_at_puts_the_first_output_near_the_mean(twill):
    network = WovenNetwork(SMALL)
    network.start_at(torch.tensor([[0.02, 0.01, 0.1, 0.2], [0.04, 0.03, 0.1, 0.2]]))
    output = Woven(network).predict(twill, queries(np.linspace(0, 4, 100), 1.0, 0.5)).mean(axis=0)
    np.testing.assert_allclose(output, [0.03, 0.02, 0.1, 0.2], atol=0.05)
