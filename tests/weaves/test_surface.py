import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.presets import PRESETS
from weaves.draft import Draft, cells
from weaves.fabric import Fabric, load_fabric
from weaves.surface import GAP, WARP, WEFT, curvature, surface_at, surface_maps
from weaves.yarn import Yarn


def cloth(draft=None, warp=None, weft=None):
    """Return a fabric whose yarns differ in everything."""
    table = {"name": "cloth", "draft": draft or {"family": "twill", "over": 3, "under": 1}}
    table["warp"] = {"bend": 30, "twist": -25, "roughness": 0.3, **(warp or {})}
    return Fabric.model_validate(table | {"weft": {"bend": 40, "twist": 15, "roughness": 0.3, **(weft or {})}})


NARROW = {"width": 0.6, "relief": 0.7}
CLOTHS = {
    "closed": cloth(),
    "relief": cloth(warp={"relief": 0.4}, weft={"relief": 1.8}),
    "gaps": cloth(warp=NARROW, weft={"width": 0.75, "relief": 1.3}),
    "steep beneath": cloth({"family": "plain"}, {"bend": 65, "width": 0.8}, {"bend": 70, "width": 0.85}),
    "satin": cloth({"family": "satin", "ends": 5, "move": 2}, {"bend": 40}, {"bend": 60, "width": 0.7}),
    "never changing side": cloth({"family": "matrix", "rows": ["##.", "##."]}, NARROW, NARROW),
    "no bend": cloth(warp={"bend": 0}, weft={"bend": 0, "width": 0.5}),
}


def random_points(fabric, count=4000, seed=1):
    ends, picks = fabric.weave.repeat
    return np.random.default_rng(seed).random((2, count)) * np.array([[ends], [picks]])


def test_a_plain_float_by_hand():
    """L = 1, u_max = 30°: R = 1, r = 1/2, so the crown is 1 + 1/2 - cos 30° high; the fibres lie at psi to the yarn.

    Off the axis sin v = x/r, sin u = y/(R + r cos v): at x = .25, y = .3."""
    fabric = cloth({"family": "plain"}, {"bend": 30, "twist": 20}, {"bend": 30, "twist": 20})
    sine, cosine = np.sin(np.radians(20)), np.cos(np.radians(20))
    seen = surface_at(fabric, [0.5, 1.5], [0.5, 0.5])
    assert seen.yarn.tolist() == [WARP, WEFT] and np.allclose(seen.height, 1.5 - np.sqrt(0.75), rtol=1e-15)
    assert np.allclose(seen.normal, [0, 0, 1], atol=1e-16)
    assert np.allclose(seen.tangent, [[-sine, cosine, 0], [-cosine, -sine, 0]], atol=1e-15)
    cos_v = np.sqrt(0.75)
    sin_u = 0.3 / (1 + 0.5 * cos_v)
    cos_u = np.sqrt(1 - sin_u**2)
    warp = surface_at(fabric, 0.75, 0.8)
    along, across = np.array([0, cos_u, -sin_u]), np.array([cos_v, -0.5 * sin_u, -0.5 * cos_u])
    assert np.allclose(warp.normal, [0.5, sin_u * cos_v, cos_u * cos_v], rtol=1e-14)
    assert np.allclose(warp.tangent, cosine * along - sine * across, rtol=1e-14)
    assert np.isclose(warp.height, np.sqrt((1 + 0.5 * cos_v) ** 2 - 0.09) - cos_v, rtol=1e-14)


@pytest.mark.parametrize("fabric", CLOTHS.values(), ids=CLOTHS)
def test_normal_and_tangent_are_unit_and_orthogonal_and_the_gradient_of_the_height(fabric):
    """Also at a tiny negative place, which is congruent to the end of the repeat."""
    seen = surface_at(fabric, *(np.append(column, -1e-20) for column in random_points(fabric)))
    yarn = seen.yarn != GAP
    assert np.allclose(np.linalg.norm(seen.normal, axis=-1), 1, atol=1e-14)
    assert np.allclose(np.linalg.norm(seen.tangent[yarn], axis=-1), 1, atol=1e-14)
    assert np.abs((seen.normal * seen.tangent).sum(-1)).max() < 1e-14 and (seen.normal[..., 2] >= 0).all()
    assert np.isfinite(seen.height[yarn]).all()
    # Central differences of step h = 1e-5 at points whose neighbours lie on the same float.  Expected: n =
    # (-dz/dx, -dz/dy, 1) normalised. Points within 2 % of a yarn's side are left out, where the third derivative
    # makes the differences themselves inexact (error h² z'''/6); what is left agrees to 2e-6.
    step = 1e-5
    x, y = random_points(fabric)
    seen = surface_at(fabric, x, y)
    shifted = [surface_at(fabric, x + dx, y + dy) for dx, dy in ((step, 0), (-step, 0), (0, step), (0, -step))]
    across = np.where(seen.yarn == WARP, x, y) % 1 - 0.5
    half_width = np.where(seen.yarn == WARP, fabric.warp.width, fabric.weft.width) / 2
    inside = (seen.yarn != GAP) & (np.abs(across) < 0.98 * half_width)
    inside &= (np.abs(x % 1 - 0.5) < 0.49) & (np.abs(y % 1 - 0.5) < 0.49)
    for other in shifted:
        inside &= (other.yarn == seen.yarn) & (other.under == seen.under)
    right, left, up, down = (other.height[inside] for other in shifted)
    gradient = np.stack([left - right, down - up, np.full(inside.sum(), 2 * step)], axis=-1)
    gradient /= np.linalg.norm(gradient, axis=-1, keepdims=True)
    assert inside.sum() > 500 and np.abs(gradient - seen.normal[inside]).max() < 2e-6
    if (fabric.warp.width < 1) or (fabric.weft.width < 1):
        assert seen.under[inside].any()


def test_yarn_beneath_is_smooth_and_ends_with_the_bend_and_flat_floats_are_straight():
    """Along the axis of a weft beneath narrow warps: no kink where the arc ends, inclination never above u_max."""
    fabric = CLOTHS["steep beneath"]
    y = np.array([0.5, 0.75])[:, None]
    x = np.linspace(0.901, 0.999, 2001)
    seen = surface_at(fabric, x, y)
    assert seen.under.all()
    slope = np.diff(seen.height, axis=1) / np.diff(x)
    # On the axis |dz/dx| = tan |u|: at most tan u_max, and constant once the arc has ended.
    assert np.abs(slope[0]).max() < np.tan(np.radians(70)) + 1e-6 and np.abs(np.diff(slope, axis=1)).max() < 1e-3
    # Without bend, without change of side, or shorter than w sin u_max: a straight cylinder.
    yarn = Yarn(bend=80, roughness=0.5, width=1.0)
    assert curvature(yarn, [0.98, 0.99, np.inf]).tolist() == [0, 2 * np.sin(np.radians(80)) / 0.99, 0]
    for name in ("never changing side", "no bend"):
        seen = surface_at(CLOTHS[name], 0.5 + 0.125, np.linspace(0, 4, 33))
        warp = seen.yarn == WARP
        width, relief = CLOTHS[name].warp.width, CLOTHS[name].warp.relief
        assert warp.any() and np.allclose(seen.height[warp], relief * np.sqrt(width**2 / 4 - 0.125**2))


def oracle_height(k, half_length, bend, r, x, y):
    """Return the height in 50 digits, by the plain formula that floating point would cancel."""
    with mpmath.workdps(50):
        u_max = mpmath.mpf(bend) * mpmath.pi / 180
        big = mpmath.mpf(2 * half_length) / (2 * mpmath.sin(u_max))
        rise = mpmath.sqrt(mpmath.mpf(r) ** 2 - mpmath.mpf(x) ** 2)
        if k > 0:
            return mpmath.sqrt((big + rise) ** 2 - mpmath.mpf(y) ** 2) - big * mpmath.cos(u_max)
        return big * mpmath.cos(u_max) - mpmath.sqrt((big - rise) ** 2 - mpmath.mpf(y) ** 2)


@pytest.mark.parametrize("bend", [60.0, 12.0, 1.0, 1e-2, 1e-5, 1e-9, 1e-14])
def test_height_is_exact_for_any_bend(bend):
    """Against 50 digits, on top (3 cells long) and beneath (1 cell long): relative error below 1e-12 in float64."""
    fabric = cloth(warp={"bend": bend, "width": 0.5}, weft={"bend": bend, "width": 0.5})
    found = cells(fabric.weave)
    warp_over = np.argwhere(found.top == WARP)
    for pick, end in warp_over[:3]:
        offset, half = found.top_offset[pick, end], found.top_length[pick, end] / 2
        for dx, dy in ((0.0, 0.0), (0.125, 0.25), (-0.234375, -0.46875)):
            exact = oracle_height(1, half, bend, 0.25, dx, dy + offset)
            seen = surface_at(fabric, end + 0.5 + dx, pick + 0.5 + dy)
            assert not seen.under and abs(float(seen.height) / exact - 1) < 1e-12
        # Beside the warp the weft shows; its frame is (y, -x), and its run beneath the warps is one float.
        offset, half = found.under_offset[pick, end], found.under_length[pick, end] / 2
        dx, dy = 0.3125, 0.125
        exact = oracle_height(-1, half, bend, 0.25, dy, -(dx + offset))
        seen = surface_at(fabric, end + 0.5 + dx, pick + 0.5 + dy)
        assert seen.under
        if abs(dx + offset) < half - 0.25 * np.sin(np.radians(bend)):
            assert abs(float(seen.height) / exact - 1) < 1e-12


TIMES, STEPS = st.integers(-1000, 1000), st.integers(0, 2**16)


@settings(max_examples=50)
@given(st.sampled_from(sorted(CLOTHS)), st.tuples(TIMES, TIMES), st.tuples(STEPS, STEPS))
def test_translation_by_repeats_changes_nothing(name, times, steps):
    """Positions are multiples of 2^-13, which stay exact under the translation: equal to the last bit."""
    place = np.array(steps) / 2**13
    here, there = (
        surface_at(CLOTHS[name], *at) for at in (place, place + np.multiply(times, CLOTHS[name].weave.repeat))
    )
    for column, other in zip(here, there, strict=True):
        np.testing.assert_array_equal(column, other)


@pytest.mark.parametrize("name", ["closed", "gaps", "satin"])
def test_a_quarter_turn_of_the_cloth_turns_what_is_seen(name):
    """Turn draft and points by 90°: (x, y) -> (-y, x), warps become wefts; a fibre's direction has no sign."""
    fabric = CLOTHS[name]
    over = fabric.weave.warp_over
    draft = {"family": "matrix", "rows": Draft(~over.T[:, ::-1]).rows()}
    swapped = {"draft": draft, "warp": fabric.weft, "weft": fabric.warp}
    turned = Fabric.model_validate(fabric.model_dump() | swapped)
    x, y = random_points(fabric, 500)
    before, after = surface_at(fabric, x, y), surface_at(turned, -y, x)

    def turn(vector):
        return np.stack([-vector[:, 1], vector[:, 0], vector[:, 2]], axis=-1)

    assert np.array_equal(before.yarn == GAP, after.yarn == GAP)
    assert np.array_equal(before.yarn == WARP, after.yarn == WEFT)
    covered = before.yarn != GAP
    assert np.allclose(before.height[covered], after.height[covered], atol=1e-12)
    assert np.allclose(turn(before.normal), after.normal, atol=1e-6)
    along = (turn(before.tangent) * after.tangent).sum(-1)[covered]
    assert np.allclose(np.abs(along), 1, atol=1e-10)


def test_widths_decide_what_shows_and_relief_scales_height_and_slope():
    """Areas in plain weave: a warp of width g covers g of its cells; the gaps are (1 - g_warp)(1 - g_weft)."""
    seen = surface_maps(cloth({"family": "plain"}, {"width": 0.75}, {"width": 0.5}), 64)
    assert np.isclose((seen.yarn == GAP).mean(), 0.25 * 0.5)
    assert np.isclose(((seen.yarn == WARP) & ~seen.under).mean(), 0.5 * 0.75)
    assert np.isclose(((seen.yarn == WARP) & seen.under).mean(), 0.5 * 0.5 * 0.75)
    under, height, normal, tangent = (column[seen.yarn == GAP] for column in seen[1:])
    assert (height == -np.inf).all() and (normal == [0, 0, 1]).all() and not under.any() and not tangent.any()
    flat, raised = cloth(), cloth(warp={"relief": 0.5}, weft={"relief": 0.5})
    x, y = random_points(flat, 500)
    one, half = surface_at(flat, x, y), surface_at(raised, x, y)
    assert np.allclose(half.height, one.height / 2)
    slope = one.normal[:, :2] / one.normal[:, 2:]
    assert np.allclose(half.normal[:, :2] / half.normal[:, 2:], slope / 2)


@pytest.mark.parametrize("name", PRESETS)
def test_maps_sample_texel_centres_row_by_row_from_pick_0(name):
    fabric = load_fabric(name)
    maps = surface_maps(fabric, 3)
    ends, picks = fabric.weave.repeat
    assert maps.height.shape == (3 * picks, 3 * ends)
    assert np.array_equal(maps.yarn[1::3, 1::3] == WARP, fabric.weave.warp_over)
    one = surface_at(fabric, (4 + 0.5) / 3, (2 + 0.5) / 3)
    assert maps.height[2, 4] == one.height and np.array_equal(maps.tangent[2, 4], one.tangent)
