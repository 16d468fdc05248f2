import math

import numpy as np
import pytest
import torch

from pipeline.models.woven import WovenOptions
from pipeline.models.woven.encoder import read_cloth
from pipeline.models.woven.model import Woven, WovenNetwork
from pipeline.models.woven.standard_position import SYMMETRIES, moved, placement
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from tests.pipeline.models.stand_ins import SMALL, batch_of
from tests.pipeline.truth.cloths import woven
from weaves.errors import BadInput
from weaves.fabric import load_fabric

WOVEN = SMALL["woven"]
TWILL = load_fabric("cotton_twill")


@pytest.mark.parametrize(
    ("changes", "more", "picture"),
    [
        ({"one_blob": "local"}, 64 * 128, 64),
        # The first layer alone changes: 3 numbers enter it in place of 24.
        ({"one_blob": "none"}, -21 * 128, 0),
        ({"one_blob": "periodic", "spatial_fusion": False}, 94 * 128 + 129 * (128 + 128 + 64) + 65 * 4 - 86_660, 0),
    ],
)
def test_parameters_and_bytes_of_the_decoder(changes, more, picture):
    """0.35 MB with the latent; a picture costs its filters and itself."""
    network = WovenNetwork(WovenOptions(**changes))
    assert network.architecture()["parameters"]["decoder"] == 86_660 + more
    assert Woven(network).bytes_stored(TWILL) == 4 * (86_660 + more + 64 + picture)


@pytest.mark.parametrize(("place", "decoder", "joined"), [("fusion", 86_660, 50_112), ("encoder", 70_148, 66_624)])
def test_both_readings_of_the_paper_have_their_counts(place, decoder, joined):
    network = WovenNetwork(WovenOptions(one_blob="plain", extra_layer=place))
    assert network.architecture()["parameters"]["decoder"] == decoder
    of_maps = ("maps", "flat", "picture")
    parts = [p for name, p in network.encoder.named_parameters() if not name.startswith(of_maps)]
    assert sum(p.numel() for p in parts) == joined


def test_bare_numbers_and_the_bias_are_at_their_start_and_transmission_sees_widths():
    """The decoder is handed u, v as shares and log2 of the size over its range: sigma = .4 of 4 yarns is .1 repeat."""
    network = WovenNetwork(WOVEN.model_copy(update={"one_blob": "none", "standard": False}))
    handed, seen = [], network.decoder.seen
    network.decoder.seen = lambda *inputs: handed.append(inputs) or seen(*inputs)
    Woven(network).predict(TWILL, Queries.round([5.0], [3.0], [0.4], [[0.6, 0.0, 0.8]], [[0.0, -0.28, 0.96]]))
    size = math.log(0.1 / 0.005) / math.log(1.0 / 0.005)
    assert handed[0][1] is None
    assert handed[0][2].flatten().tolist() == pytest.approx([0.25, 0.75, size], abs=1e-6)
    network = WovenNetwork(WOVEN)
    before = network.decoder.last.weight.detach().clone()
    target = torch.tensor([[0.02, 0.01, 0.1, 0.2], [0.04, 0.03, 0.1, 0.4]])
    network.start_at(target)
    k = WOVEN.log_k
    expected = [(math.log1p(k * 0.02) + math.log1p(k * 0.04)) / 2, (math.log1p(k * 0.01) + math.log1p(k * 0.03)) / 2]
    assert network.decoder.last.bias.tolist() == pytest.approx([*expected, 0.1, 0.3], rel=1e-5)
    assert network.decoder.last.weight.abs().max() < 0.05 * before.abs().max()
    # Cloths that differ in width or blend alone have other inputs; transparency stays in [0, 1]; off, it is 0.
    options = WOVEN.model_copy(update={"transmission": True})
    voile = load_fabric("voile")
    method = Woven(WovenNetwork(options))
    cloth = read_cloth([voile, *(woven("voile", warp=change) for change in ({"width": 0.6}, {"blend": 0.9}))], options)
    assert cloth.parameters.shape == (3, 9) and len(cloth.parameters.unique(dim=0)) == 3
    asked = draw_queries(QueryOptions(behind=0.5), voile.weave.repeat, 1, 0, 64)
    share = method.transparency(voile, asked)
    assert share.shape == (64,) and ((share >= 0) & (share <= 1)).all()
    assert method.predict(voile, asked).shape == (64, 4)
    assert not Woven(WovenNetwork(WOVEN)).transparency(voile, asked).any()


@pytest.mark.parametrize("one_blob", ["none", "plain", "periodic", "local"])
def test_training_sees_what_rendering_sees(one_blob):
    """The loss against the network's own predictions is 0: training and inference place queries alike."""
    options = WOVEN.model_copy(update={"one_blob": one_blob, "roll": False})
    network = WovenNetwork(options, [load_fabric("denim"), TWILL])
    network.start_at(torch.full((2, 4), 2.0))  # far from 0, where outputs would be clamped
    asked = draw_queries(QueryOptions(), TWILL.weave.repeat, 1, 0, 64)
    batch = batch_of(asked, Woven(network).predict(TWILL, asked), 1)
    assert network.loss(batch, np.random.default_rng(0)).item() < 1e-10


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_mirror_images_are_answered_alike(symmetry):
    """Standard position makes it exact, with any weights, for a cloth without symmetries of its own."""
    method = Woven(WovenNetwork(WOVEN))
    cloth = woven("cotton_twill", ("##.#.", ".##.#", "#...#", ".#.##"))
    asked = draw_queries(QueryOptions(), cloth.weave.repeat, 1, 0, 200)
    place, (ends, picks) = placement(cloth, symmetry, (0, 0)), cloth.weave.repeat
    columns = asked.u / ends, asked.v / picks, asked.wi, asked.wo
    u, v, wi, wo = (torch.from_numpy(column)[None] for column in columns)
    u, v, wi, wo = (part[0].numpy() for part in (*place.move(u, v), place.turn(wi), place.turn(wo)))
    image = moved(cloth, symmetry)
    ends, picks = image.weave.repeat
    there = Queries.round(u * ends, v * picks, asked.sigma, wi, wo)
    expected = place.swap(torch.from_numpy(method.predict(cloth, asked))[None])[0]
    np.testing.assert_allclose(method.predict(image, there), expected, rtol=2e-3, atol=2e-5)


@pytest.mark.parametrize("standard", [False, True])
def test_between_two_fabrics_lie_both_at_its_ends(standard):
    """A 3/1 twill has one standard position whatever its yarns are, so that the second end is the second fabric too."""
    method = Woven(WovenNetwork(WOVEN.model_copy(update={"standard": standard})))
    satin = load_fabric("satin_8")
    second = TWILL.model_copy(update={"name": "other", "warp": satin.warp, "weft": satin.weft})
    asked = draw_queries(QueryOptions(), TWILL.weave.repeat, 1, 0, 200)
    one, other = method.predict(TWILL, asked), method.predict(second, asked)
    assert np.abs(one - other).max() > 1e-3
    # Two fabrics at once are summed in another order than one: single precision.
    for end, share, expected in ((second, 0.0, one), (second, 1.0, other), (TWILL, 0.3, one)):
        between = method.predict_between(TWILL, end, share, asked)
        np.testing.assert_allclose(between, expected, rtol=1e-4, atol=1e-5)
    with pytest.raises(BadInput, match="the repeat of cotton_twill is needed, 4 x 4, to blend the two"):
        method.predict_between(TWILL, satin, 0.5, asked)


def test_a_colour_edit_needs_no_encoding_and_another_yarn_does():
    method, runs = Woven(WovenNetwork(WOVEN)), []
    method.network_of(TWILL).encoder.register_forward_hook(lambda module, inputs, output: runs.append(1))
    for changes, encoded in (({}, 1), ({"diffuse": (0.1, 0.2, 0.3)}, 1), ({"roughness": 0.31}, 2)):
        method.prepare(woven("cotton_twill", warp=changes))
        assert len(runs) == encoded
