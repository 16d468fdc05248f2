import numpy as np

from pipeline.scenes.gbuffer import GBuffer
from weaves.fabric import load_fabric
from weaves.variation import Variation


def gbuffer(count):
    """Return places of random footprints, each under two lights."""
    random = np.random.default_rng(3)
    wo, wi = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in random.normal(size=(2, 2 * count, 3)))
    sigma_minor = random.uniform(0.01, 1.0, count)
    footprint = (sigma_minor * random.uniform(1.0, 5.0, count), sigma_minor, random.uniform(-1.5, 1.5, count))
    places = (*random.uniform(0.0, 50.0, (2, count)), *footprint, np.zeros(count), wo[:count])
    lights = (np.tile(np.arange(count), 2), wi, np.ones((2 * count, 3)))
    return GBuffer(np.ones((1, count), bool), np.arange(count), *places, *lights, np.arange(3), wo[:3])


def covariance(part):
    cosine, sine = np.cos(part.angle), np.sin(part.angle)
    axes = np.stack([cosine, -sine, sine, cosine], axis=-1).reshape(-1, 2, 2)
    return axes @ (np.stack([part.sigma, part.sigma_minor], axis=-1)[..., None] ** 2 * axes.transpose(0, 2, 1))


def test_footprints_are_stretched_and_directions_turn_with_the_yarns():
    fabric, before = load_fabric("denim"), gbuffer(200)
    assert before.varied(fabric) is before
    variation = Variation(spacing=0.1, skew=0.1)
    after = before.varied(fabric.model_copy(update={"variation": variation}))
    place, jacobian = variation.lattice(fabric.weave.repeat, np.stack([before.u, before.v], axis=-1))
    np.testing.assert_array_equal([after.u, after.v], place.T)
    stretched = np.einsum("nij,njk,nlk->nil", jacobian, covariance(before), jacobian)
    np.testing.assert_allclose(covariance(after), stretched, rtol=1e-9)
    # The polar factor of the derivative.
    left, _, right = np.linalg.svd(jacobian)
    for own, moved, turn in ((before.wo, after.wo, left @ right), (before.wi, after.wi, (left @ right)[before.place])):
        np.testing.assert_allclose(moved[:, :2], np.einsum("nij,nj->ni", turn, own[:, :2]), atol=1e-12)
        np.testing.assert_array_equal(moved[:, 2], own[:, 2])
    np.testing.assert_array_equal(after.rim_wo, after.wo[:3])
