import math

import numpy as np
import pytest

from pipeline.analytic.mip_levels import mip_levels
from pipeline.analytic.parallax_mapping import HeightMaps
from pipeline.materials.lobes import charlie, even_sky, ggx, reflectance, white_f0
from pipeline.materials.lookup import answer, tabulate
from pipeline.materials.planes import Layout, Planes
from pipeline.materials.textures import Constants
from pipeline.truth.query import Queries
from weaves.fabric import load_fabric

SPECULAR = 0.5
SHEEN = np.array([0.02, 0.01, 0.06, 0.03])
MATERIAL = Constants(1.5, 0.2, np.zeros(3), 0.0, False)


LEVEL_GROUND = HeightMaps(mip_levels([np.zeros((1, 1, 1))], (4, 4)), 0.0, 0.0)


def maps_of(pattern, sheen=SHEEN):
    """Return maps of one material, fibres along a slanted direction; `pattern` (H, W) is the opacity."""
    normal, fibre = np.array([0.1, 0.2, 0.97]), np.array([0.8, 0.6, -0.2])
    normal /= np.linalg.norm(normal)
    fibre -= normal * (fibre @ normal)
    fibre /= np.linalg.norm(fibre)
    entries = 0.9 * np.array([fibre[a] * fibre[b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])

    def plane(values):
        return (pattern[..., None] * np.asarray(values)).astype(np.float32)

    colours = {"base": (0.3, 0.2, 0.0), "specular": (0.08, 0.04, 0.0), "through": (0.1, 0.05, 0.0)}
    planes = {name: plane(values) for name, values in {"normal": normal, "fibres": entries, **colours}.items()}
    level = Planes(coverage=pattern.astype(np.float32), height=np.zeros_like(pattern, np.float32), **planes)
    shown = Layout(4, 4, *pattern.shape[::-1])
    return tabulate(level, MATERIAL, shown, sheen, SPECULAR, LEVEL_GROUND), normal, fibre


def test_one_material_is_the_sum_of_its_lobes_and_white_f0_returns_the_reflectance_of_the_truth():
    maps, normal, fibre = maps_of(np.full((8, 8), 0.75))
    frame = np.stack([fibre, np.cross(normal, fibre), normal])
    wi, wo = even_sky(64), np.array([0.3, -0.2, 0.9])
    wo /= np.linalg.norm(wo)
    local, viewer = wi @ frame.T, frame @ wo
    kept = local[:, 2] > 0.05
    wi, local = wi[kept], local[kept]
    none = np.zeros(len(wi))
    found = answer(maps, Queries.round(none, none, none + 0.5, wi, np.tile(wo, (len(wi), 1))))
    cosine, f0 = local[:, 2], np.array([0.08, 0.04])
    lobe = ggx(local, viewer, math.sqrt(0.1), 1.0, np.full(3, f0.sum()))[:, 0] * cosine
    half = local + viewer
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    fresnel = f0.sum() + (1 - f0.sum()) * (1 - half @ viewer) ** 5
    sheen = (charlie(local, viewer) * cosine)[:, None] * SHEEN
    angle = even_sky(1 << 14)
    under = 1 - SHEEN.sum() * math.pi * charlie(angle, np.array([math.sqrt(1 - viewer[2] ** 2), 0, viewer[2]])).mean()
    specular = (under * lobe[:, None] * f0 / f0.sum() + sheen[:, :2]) / SPECULAR
    base = under * ((1 - fresnel) * cosine)[:, None] * (0.3, 0.2) / math.pi + sheen[:, 2:]
    np.testing.assert_allclose(found, 0.75 * np.concatenate([specular, base], axis=1), rtol=2e-3)
    maps, normal, _ = maps_of(np.ones((8, 8)), np.zeros(4))
    wi = np.array([[0.0, 0.6, -0.8]])
    found = answer(maps, Queries.round(*np.zeros((2, 1)), np.ones(1), wi, np.array([[0.0, 0.0, 1.0]])))
    np.testing.assert_allclose(found, [np.array([0, 0, 0.1, 0.05]) / math.pi * -(wi[0] @ normal)], rtol=1e-5)
    fabric = load_fabric("denim")
    share, up = reflectance(fabric), np.array([0.0, 0.0, 1.0])
    # Another rule than that of the code: a grid of square and turn.
    square, turn = np.stack(np.meshgrid(*[(np.arange(96) + 0.5) / 96] * 2), -1).reshape(-1, 2).T
    z, turn = np.sqrt(square), 2 * math.pi * turn
    wi = np.stack([np.sqrt(1 - square) * np.cos(turn), np.sqrt(1 - square) * np.sin(turn), z], -1)
    for family, yarn in enumerate((fabric.warp, fabric.weft)):
        f0 = np.full(3, white_f0(fabric, share)[family])
        lobe = math.pi * ggx(wi, up, yarn.roughness, 1.0, f0)[:, 0].mean()
        assert lobe * share.coverage[family] == pytest.approx(share.specular[family], rel=0.02)


@pytest.mark.parametrize(
    ("major", "minor", "angle"),
    [(0.2, 0.2 / 6, 0.0), (0.4, 0.4 / 6, 0.0), (0.5, 0.5 / 6, 0.5), (1.6, 0.1, math.pi / 2)],
)
def test_footprints_average_as_a_gaussian(major, minor, angle):
    """A wave of period 4 along x is damped by exp(-2 pi^2 s_x^2 / 16), s_x the footprint's deviation along x."""
    columns = (np.arange(256) + 0.5) / 256
    maps, *_ = maps_of(np.tile(0.5 + 0.4 * np.cos(2 * math.pi * columns), (256, 1)), np.zeros(4))
    up, none = np.tile([0.0, 0.0, 1.0], (2, 1)), np.zeros(2)
    queries = Queries(np.array([0.0, 2.0]), none + 0.3, none + major, up, up, none + minor, none + angle, none)
    high, low = answer(maps, queries)[:, 2]
    along = math.hypot(major * math.cos(angle), minor * math.sin(angle))
    assert (high - low) / (high + low) == pytest.approx(0.8 * math.exp(-2 * math.pi**2 * along**2 / 16), rel=0.02)
