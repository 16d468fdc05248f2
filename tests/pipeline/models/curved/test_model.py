import math

import numpy as np
import pytest
import torch

from pipeline.fingerprint import IDENTITY, fingerprint
from pipeline.models.curved.model import Curved, CurvedNetwork, SilhouetteData, View
from pipeline.models.domain import Domain
from pipeline.models.neumip import NeumipOptions
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.truth.geometry.heightfield import height_field
from pipeline.truth.query import Queries
from tests.pipeline.models.stand_ins import SMALL, batch_of, descend, untrained
from tests.pipeline.truth.cloths import woven
from tests.refusals import refusal
from weaves.errors import BadInput
from weaves.fabric import load_fabric

CURVED = SMALL["curved"]
GRAZING = CURVED.model_copy(update={"silhouette": "grazing"})
DENIM = load_fabric("denim")


def _wo(cosine, azimuth=0.0):
    sine = np.sqrt(1 - np.square(cosine))
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine + 0 * azimuth], -1).astype(np.float32)


def _view(cosine, curvature, sigma=2.0):
    wo = torch.from_numpy(_wo(np.atleast_1d(cosine)))
    full = torch.full((len(wo),), 0.3)
    return View(full, full, torch.full_like(full, sigma), wo, torch.full_like(full, curvature))


def _queries(count, curvature=0.1, behind=False):
    random = np.random.default_rng(count)
    wo = _wo(random.uniform(0.05, 1, count), random.uniform(0, 6, count))
    wi = wo[::-1] * np.float32([1, 1, -1 if behind else 1])
    u, v, sigma = random.uniform(0.1, 4, (3, count)).astype(np.float32)
    return Queries.round(u, v, sigma, wi, wo)._replace(curvature=np.full(count, curvature, np.float32))


def _method(domain=None):
    return Curved({fingerprint(DENIM.optics()): CurvedNetwork(CURVED, DENIM.weave.repeat)}, domain)


def test_published_sizes():
    """One texture and three hidden layers of 24 for each module; directions x and y, curvature as it is."""
    options = CURVED.model_copy(update={"levels": 1, "directions": "projected", "curvature_input": "linear"})
    network = CurvedNetwork(options, (4, 4))
    parts, hidden = ("opacity", "offset", "decoder"), [(24, 24), (24, 24)]
    linear = {name: [part for part in getattr(network, name) if hasattr(part, "weight")] for name in parts}
    widths = {name: [layer.weight.shape for layer in layers] for name, layers in linear.items()}
    assert widths["opacity"] == widths["offset"] == [(24, 7 + 3), *hidden, (1, 24)]
    assert widths["decoder"] == [(24, 7 + 5), *hidden, (4, 24)]
    assert len(network.levels) == len(network.opacity_levels) == 1
    assert network.architecture()["parameters"]["textures"] == 3 * 7 * 16 * 16


@pytest.mark.parametrize("way", ["linear", "root", "touch"])
def test_curvature_enters_as_asked(way):
    network = CurvedNetwork(CURVED.model_copy(update={"curvature_input": way}), (4, 4))
    seen = network._view(_view([0.6, 1.0], 0.25))
    expected = {"linear": [0.25], "root": [0.5], "touch": [0.5, 0.75 / math.sqrt(0.75**2 + 0.5)]}[way]
    torch.testing.assert_close(seen[0], torch.tensor([0.8, 0.0, 0.6, *expected]))
    if way == "touch":
        assert seen[1, -1] == 1.0  # straight down
        assert network._view(_view([0.01], 0.0))[0, -1] == 1.0  # flat: a ray never turns


def test_neither_opacity_nor_offset_knows_the_light_and_rays_below_every_yarn_have_hit_one():
    method, queries = _method(), _queries(50)
    other = queries._replace(wi=-queries.wi)
    np.testing.assert_array_equal(method.coverage(DENIM, queries), method.coverage(DENIM, other))
    assert (method.predict(DENIM, queries) != method.predict(DENIM, other)).any()
    # tan^2 >= 2 kappa fall; on flat cloth any ray. A network with gaps knows no such thing.
    fall, curvature = 0.5, 0.1
    edge = math.sqrt(2 * curvature * fall)
    cosine = edge / math.sqrt(1 + edge * edge) * np.array([0.99, 1.01])
    network = CurvedNetwork(CURVED, (4, 4), fall=fall)
    below, above = network.cover(_view(cosine, curvature)).tolist()
    assert below < 1.0 and above == 1.0
    assert network.cover(_view([0.001], 0.0)).tolist() == [1.0]
    assert CurvedNetwork(CURVED, (4, 4)).cover(_view([0.9], 0.0)).item() < 1.0


@pytest.mark.slow
def test_a_cloth_with_gaps_is_never_certain():
    """The fall is a part of the weights; the silhouettes are none."""
    front, network = height_field(DENIM), untrained(CURVED, DENIM)
    assert network.fall.item() == pytest.approx(front.highest - front.lowest)
    assert "fall" in network.state_dict() and not [name for name in network.state_dict() if "silhouettes" in name]
    assert untrained(CURVED, woven("denim", width=0.7)).fall.item() < 0.0


def test_opacity_of_the_grazing_variant_is_the_gaussian_share_below_the_cosine():
    """Which does not depend on the angle of the view."""
    network = CurvedNetwork(GRAZING, (4, 4))
    steep, flat = (torch.stack(network.grazing(_view([cosine], 0.2))) for cosine in (0.9, 0.1))
    torch.testing.assert_close(steep, flat)
    with torch.no_grad():
        for weight in network.opacity.parameters():
            weight.zero_()
        network.opacity[-1].bias.copy_(torch.tensor([0.4, -50.0]))
    mean, deviation = network.grazing(_view([0.1], 0.25))
    assert (mean.item(), deviation.item()) == (pytest.approx(0.4), pytest.approx(0.02))
    # In units of sqrt(kappa) = 0.5: the step lies at 0.2, and its width is 0.01.
    found = network.cover(_view([0.17, 0.19, 0.2, 0.21, 0.23], 0.25)).tolist()
    assert found == pytest.approx([0.00135, 0.15866, 0.5, 0.84134, 0.99865], abs=1e-4)
    assert network.cover(_view([0.01], 0.0)).tolist() == [1.0]


@pytest.mark.parametrize("options", [CURVED, GRAZING])
def test_silhouettes_are_learnt(options):
    """A few hundred steps find opacities that no constant comes near; silhouettes alone, which no light concerns."""
    options = options.model_copy(update={"silhouette_rows": 2048, "blur": 0.0})
    network = untrained(options, DENIM).train()
    optimiser = torch.optim.Adam(network.parameter_groups(5e-3))
    random = np.random.default_rng(3)
    losses = descend(optimiser, 120, lambda _: network._edge_loss(*network.silhouettes.draw(128, random)))
    assert min(losses) > 0 or options.silhouette == "opacity"
    other = CURVED.extra_rows[0].model_copy(update={"seed": 5, "points": 256})
    others = SilhouetteData(other.answer(DENIM, 0, 512), DENIM.weave.repeat)
    view = View(*(others.get_buffer(name) for name in View._fields))
    target = others.get_buffer("target")[:, 0]
    error = (network.eval().cover(view).detach() - target).square().mean().sqrt()
    assert target.std() > 0.3 and error < 0.35 * target.std()


def test_loss_adds_the_silhouettes_and_those_at_extremes_are_shares():
    network = untrained(CURVED, DENIM).eval()
    batch = batch_of(_queries(64), torch.rand(64, 4))
    both = network.loss(batch, np.random.default_rng(1))
    edge = network._edge_loss(*network.silhouettes.draw(64, np.random.default_rng(1)))
    network.silhouettes = None
    alone = network.loss(batch, np.random.default_rng(1))
    torch.testing.assert_close(both, alone + CURVED.silhouette_weight * edge)
    method = _method()
    for behind in (False, True):
        queries = _queries(40, behind=behind)
        queries = queries._replace(u=queries.u * np.float32(1e6), sigma=queries.sigma * np.float32(1e-4))
        prediction, covered = method.predict(DENIM, queries), method.coverage(DENIM, queries)
        assert np.isfinite(prediction).all() and (prediction >= 0).all()
        assert ((covered >= 0) & (covered <= 1)).all()
    with pytest.raises(BadInput, match=r"curvature\[3\].*trained up to 0.5"):
        method.predict(DENIM, _queries(4)._replace(curvature=np.float32([0, 0.1, 0.5, 0.6])))
    taught = _method(Domain.of({"queries": {"curvature": [0.01, 0.2], "behind": 0.0}}, [DENIM]))
    assert "trained up to 0.2" in refusal(taught.coverage, DENIM, _queries(4, curvature=0.3))
    assert "wi" in refusal(taught.predict, DENIM, _queries(4, behind=True))


def test_a_flat_material_may_take_part():
    """neumip with ignore_curvature: 0 for light from behind, rows lit from there weigh nothing, others as ever."""
    options, repeat = NeumipOptions(texels_per_yarn=4, ignore_curvature=True), DENIM.weave.repeat
    network, plain = NeumipNetwork(options, repeat), NeumipNetwork(NeumipOptions(texels_per_yarn=4), repeat)
    plain.load_state_dict(network.state_dict())
    method = Neumip({fingerprint(DENIM.optics()): network})
    front, behind = _queries(30), _queries(30, behind=True)
    assert (method.predict(DENIM, behind) == 0).all()
    assert (method.predict(DENIM, front) > 0).any()
    assert NeumipOptions.model_validate(options.model_dump(mode="json", context=IDENTITY)) == options

    random, target = np.random.default_rng(0), torch.rand(60, 4)
    both = Queries(*map(np.concatenate, zip(front, behind, strict=True)))
    blind = network.loss(batch_of(both, target), random)
    torch.testing.assert_close(blind, plain.loss(batch_of(front, target[:30]), random))
