"""The viewer in headless Chromium: what it draws against Python, its controls, pointers, keys and read-outs."""

import re

import numpy as np
import pytest

from pipeline.analytic.soft_nodes.components import read_queries
from pipeline.analytic.soft_nodes.nodes import tabulate
from pipeline.models.named import named_method
from pipeline.scenes.shade import coloured, colours
from pipeline.shader.golden import read_sides, side_colours
from pipeline.shader.tables import BEHIND, tabulate_sides
from pipeline.truth.estimator import estimate
from pipeline.truth.options import TruthOptions
from reports.viewer.shapes import seen
from reports.viewer.view import AGAINST_LIGHT, TILE, VIEWS, bent
from tests.reports.viewer.conftest import FABRIC, SIZE, shown_of, viewer
from weaves.fabric import load_fabric

pytestmark = pytest.mark.slow

CLOTH = load_fabric(FABRIC)
ENDS = CLOTH.weave.repeat[0]


def components(page, method, state="viewer.state"):
    """Return the components that the page draws, (SIZE, SIZE, 4)."""
    text = f"viewer.picture.components({state}, viewer.method('{method}'), {SIZE}).then(found => Array.from(found))"
    return np.reshape(page.run(text), (SIZE, SIZE, 4))


def expected(fabric, camera, level):
    """Return the components of soft nodes in Python, (SIZE, SIZE, 4), as the page draws them."""
    return squared(camera, lambda queries: read_queries(tabulate(fabric, level=level), queries).components)


def squared(camera, answer, through=False):
    picture = seen(camera, SIZE, ENDS, through)
    found = np.where(picture.cloth, 0.0, -1.0)[..., None] * np.ones(4)
    found[picture.lit] = answer(picture.queries)
    return found


def assert_equal(found, wanted):
    """Compare pictures: silhouettes and places near a step of a table may fall otherwise in one pixel of fifty."""
    cloth = wanted[..., 0] >= 0.0
    assert ((found[..., 0] >= 0.0) == cloth).mean() > 0.99
    span = np.ptp(wanted[cloth], axis=0)
    apart = (np.abs(found - wanted) / span).max(axis=-1)
    assert (wanted[cloth].sum(axis=1) > 0.0).mean() > 0.4 and (apart[cloth] < 5e-5).mean() > 0.98


PICTURES = [("Cloth", 8, (7, 14)), ("Horizon", 1, (10, 8)), ("Drape", 4, (12, 12))]
"""Views, levels, and a lit pixel of each, row and column, that has to be equal."""


@pytest.mark.parametrize(("name", "level", "pixel"), PICTURES)
def test_pictures_equal_python(fresh, name, level, pixel):
    fresh.run(f"viewer.go({list(VIEWS).index(name)})")
    found, wanted = components(fresh, level), expected(CLOTH, VIEWS[name], level)
    assert_equal(found, wanted)
    assert wanted[pixel].min() > 0.0 and np.abs(found - wanted)[pixel].max() < 5e-5 * wanted.max()


def test_light_comes_through_sheer_cloth(tmp_path):
    cloth = load_fabric("voile")
    sides = tabulate_sides(cloth, 2, (BEHIND,))
    (camera,), views = AGAINST_LIGHT.values(), len(VIEWS)
    with viewer(shown_of(0, (2,), (1.0,), 32, "voile"), tmp_path) as page:
        page.run(f"viewer.go({views})")
        found = components(page, 2)
        wanted = squared(camera, lambda queries: read_sides(sides, queries)[:, :4], through=True)
        assert_equal(found, wanted)
        # Gaps show the glow of the light: blacked out yarns leave it alone.
        black = "viewer.state.colours.map(() => [0, 0, 0])"
        page.run(f"viewer.set({{ colours: {black}, left: '2' }}).then(() => viewer.drawn)")
        pixels = pixels_of(page)[2]
        assert (pixels[..., 3] == 255.0).all() and pixels[..., :3].max() > 40.0


def test_without_the_shader_of_soft_nodes_points_are_shown(whole, tmp_path):
    with viewer(whole, tmp_path) as own:
        own.run(
            "viewer.picture.programs.clear(), viewer.picture.known.clear(), viewer.picture.sources.nodes = 'broken'"
        )
        own.run("viewer.set({ right: '2' }).then(() => viewer.drawn)")
        assert own.run("viewer.methods[1].label") == "One point a pixel"
        said = own.run("document.getElementById('notice').textContent")
        assert said == "Soft nodes: their shader does not compile here. One point is shown instead."


@pytest.mark.parametrize("family", ["warp", "weft"])
def test_edited_yarns_equal_tables_made_anew(fresh, family):
    yarn = getattr(CLOTH, family).model_copy(update={"roughness": 0.3, "twist": 25.0, "blend": 0.9})
    edited = CLOTH.model_copy(update={family: yarn, "optical_thickness": 5.0})
    change = f"{{ {family}: {{ roughness: 0.3, twist: 25, blend: 0.9 }}, thickness: 5 }}"
    for name in ("One yarn", "Sphere"):
        fresh.run(f"viewer.go({list(VIEWS).index(name)}), viewer.set({change})")
        assert_equal(components(fresh, 2), expected(edited, VIEWS[name], 2))


def test_a_bend_of_the_slider_equals_its_table(fresh):
    fresh.run("viewer.set({ bend: 1 })")
    assert_equal(components(fresh, 2), expected(bent(CLOTH, 1.4, 1.0), VIEWS["Drape"], 2))
    assert fresh.run("viewer.method('8').level") == 2


def test_one_point_is_the_truth_at_a_point_without_shadows(fresh):
    """Far from any shadow's edge, where light and viewer are high, a small footprint is a point."""
    fresh.run("viewer.go(0), viewer.set({ tilt: 88, distance: 4, lightTilt: 80 })")
    camera = VIEWS["One yarn"]._replace(tilt=88.0, distance=4.0, light_tilt=80.0)
    picture = seen(camera, SIZE, ENDS)
    small = picture.queries._replace(sigma=0 * picture.queries.u + 2e-3, sigma_minor=0 * picture.queries.u + 2e-3)
    truth = estimate(CLOTH, small, TruthOptions(relative_error=0.005, parallax=False), 0).mean
    found = components(fresh, "point")[picture.lit]
    apart = np.abs(found - truth).sum(axis=1) / truth.sum(axis=1).mean()
    assert np.median(apart) < 0.01 and (apart < 0.05).mean() > 0.9


def test_colours_are_those_of_the_components(fresh):
    fresh.run("viewer.set({ left: '2', right: '2' }).then(() => viewer.drawn)")
    width, height, pixels = pixels_of(fresh)
    camera = VIEWS["Drape"]
    side = min(width, height)
    assert (width - side) % 2 == (height - side) % 2 == 0  # pixels of both pictures lie on each other
    wanted = 255.0 * encoded(fresh, seen(camera, side, ENDS), side)
    box = pixels[(height - side) // 2 :, (width - side) // 2 :][:side, :side]
    apart = np.abs(box[..., :3] - wanted).max(axis=-1)
    apart = apart[~np.isnan(apart)]
    assert np.nanmax(wanted) > 100.0 and apart.size > 0.9 * box[..., 0].size and (apart <= 1.0).mean() > 0.97


def pixels_of(page):
    """Return width, height and the pixels of the canvas, (H, W, 4), row 0 the lowest, when it is drawn in full."""
    text = """(async () => {
        await viewer.draw();
        const { gl } = viewer.picture, { width, height } = viewer.canvas, found = new Uint8Array(4 * width * height);
        gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, found);
        return [width, height, Array.from(found)];
    })()"""
    width, height, values = page.run(text)
    return width, height, np.reshape(values, (height, width, 4)).astype(float)


def encoded(page, picture, side):
    """Return the sRGB values of Python for a square picture."""
    values = np.zeros((side, side, 3))
    components = read_queries(tabulate(CLOTH), picture.queries).components
    # Threads that are too far to be told apart are not a number, as are their pixels.
    values[picture.lit] = coloured(components, side_colours(tabulate_sides(CLOTH, 2, ()))(picture.queries))
    colour = np.minimum(page.run("viewer.content.irradiance") * values, 1.0)
    return np.where(colour <= 0.0031308, 12.92 * colour, 1.055 * np.maximum(colour, 1e-6) ** (1 / 2.4) - 0.055)


# ---- controls ------------------------------------------------------------------------------------------------------

MOVE = """(async () => {{
    const input = document.querySelector('[data-name="{name}"]');
    input.value = "{value}";
    input.dispatchEvent(new Event("input", {{ bubbles: true }}));
    await viewer.drawn;
}})()"""


@pytest.mark.parametrize(
    ("name", "value", "changes"),
    [
        ("Turn", "30", {"turn": 30.0}), ("Tilt", "25", {"tilt": 25.0}),
        ("Distance", str(np.log(300.0)), {"distance": 300.0}), ("Light, turn", "20", {"light_turn": 20.0}),
        ("Light, height", "70", {"light_tilt": 70.0}),
    ],
)  # fmt: skip
def test_sliders_move_viewer_and_light(fresh, name, value, changes):
    fresh.run(MOVE.format(name=name, value=value))
    if name == "Distance":
        changes = {"distance": fresh.run("viewer.state.distance")}  # in steps of a hundredth of its logarithm
        assert abs(changes["distance"] - 300.0) < 3.0
    assert_equal(components(fresh, 2), expected(CLOTH, VIEWS["Drape"]._replace(**changes), 2))


@pytest.mark.parametrize(
    ("name", "value", "moved"),
    [
        ("Warp, roughness", "0.2", [0]), ("Weft, roughness", "0.2", [1]), ("Warp, twist", "35", [0]),
        ("Weft, twist", "-35", [1]), ("Warp, round shading", "1", [2]), ("Weft, round shading", "0", [3]),
        ("Opacity", str(np.log(0.5)), [0, 1]), ("Bend", "1", [0, 1, 2, 3]),
    ],
)  # fmt: skip
def test_sliders_of_yarns_move_their_components_alone(fresh, name, value, moved):
    before = components(fresh, 2)
    fresh.run(MOVE.format(name=name, value=value))
    change = np.abs(components(fresh, 2) - before).max(axis=(0, 1)) / before.max(axis=(0, 1))
    assert [*np.flatnonzero(change > 1e-2)] == moved and (np.delete(change, moved) == 0.0).all()


def test_exposure_brightens(fresh):
    before = pixels_of(fresh)[2][..., :3]
    fresh.run(MOVE.format(name="Exposure", value="1"))
    after = pixels_of(fresh)[2][..., :3]
    assert (after >= before).all() and after.mean() > 1.1 * before.mean()


@pytest.mark.parametrize("name", ["Warp, colour", "Weft, gloss"])
def test_colours_change_the_picture_and_no_component(fresh, name):
    before, values = pixels_of(fresh)[2], components(fresh, 2)
    fresh.run(MOVE.format(name=name, value="#ff0000"))
    after = pixels_of(fresh)[2]
    assert (components(fresh, 2) == values).all()
    redder = (after[..., 0] - after[..., 2]) - (before[..., 0] - before[..., 2])
    assert redder[before[..., 3] > 0.0].mean() > 3.0


def test_the_wipe_parts_the_methods(fresh):
    fresh.run("viewer.set({ left: 'point', right: '2', wipe: 1 })")
    left = pixels_of(fresh)[2]
    fresh.run("viewer.set({ wipe: 0 })")
    right = pixels_of(fresh)[2]
    fresh.run(MOVE.format(name="Line", value="0.6"))
    both = pixels_of(fresh)[2]
    column = round(0.6 * both.shape[1])
    assert (both[:, :column] == left[:, :column]).all() and (both[:, column:] == right[:, column:]).all()
    assert np.abs(left - right).mean() > 1.0


def test_choices_and_reset(fresh):
    fresh.run("[...document.querySelectorAll('#views button')][2].click()")
    assert fresh.run("[viewer.state.shape, viewer.state.view]") == ["plane", 2]
    for side in ("left", "right"):
        fresh.run(f"byId('{side}').value = '8', byId('{side}').dispatchEvent(new Event('change'))")
        assert fresh.run(f"viewer.state.{side}") == "8"
    fresh.run("viewer.drawn")
    assert fresh.run("byId('label-left').textContent") == "Soft nodes, detail 8"
    fresh.run("byId('reset').click()")
    assert fresh.run("[viewer.state.shape, viewer.state.left]") == ["drape", "point"]


# ---- the truth and its read-out ------------------------------------------------------------------------------------


def test_the_truth_is_shown_and_errors_are_those_of_python(fresh, whole):
    fresh.run("viewer.go(3), viewer.set({ left: 'truth', right: '2' })")
    camera = VIEWS["Sphere"]
    picture = seen(camera, SIZE, ENDS)
    truth = estimate(CLOTH, picture.queries, TruthOptions(relative_error=0.01), 0).mean
    shown = components(fresh, "truth")[picture.lit]
    assert np.abs(shown - truth).max() < 1e-3 * truth.max()  # half floats
    model = read_queries(tabulate(CLOTH), picture.queries).components
    values, reference = model @ colours(CLOTH), truth @ colours(CLOTH)
    share = np.sqrt(np.square(values - reference).sum() / picture.cloth.sum() / 3) / (
        reference.sum() / picture.cloth.sum() / 3
    )
    fresh.run("viewer.drawn.then(() => viewer.measure())")
    own, other, of_truth = map(float, re.findall(r"[\d.]+", fresh.run("byId('error').textContent")))
    assert own == 0.0 and abs(other / 100 - share) < 0.06 * share
    assert 0.0 < of_truth < 3.0 and whole["views"][3]["standard_error"] < 0.02


@pytest.mark.parametrize("name", [TILE])
def test_tiles_are_the_answers_of_their_methods(fresh, name):
    fresh.run("viewer.go(3)")
    picture = seen(VIEWS["Sphere"], SIZE, ENDS)
    wanted = named_method(name, "test", "").predict(CLOTH, picture.queries)
    shown = components(fresh, name)[picture.lit]
    assert np.abs(shown - wanted).max() < 1e-3 * wanted.max()  # half floats


def test_where_the_truth_is_not_known_the_page_says_so(fresh):
    fresh.run("viewer.set({ right: 'truth', turn: 3 })")
    assert fresh.run("viewer.method('truth').label") == "Soft nodes, detail 8"
    assert "Truth: known at One yarn, Cloth, Horizon, Sphere, Drape alone" in fresh.run("byId('notice').textContent")
    fresh.run("viewer.go(4), viewer.set({ thickness: 3 })")
    assert not fresh.run("viewer.tiled('truth')")


def test_flat_footprints_are_those_of_the_truth_in_the_fabric_plane(fresh):
    """Its only view is taken when it is chosen elsewhere."""
    fresh.run("byId('left').value = 'flat', byId('left').dispatchEvent(new Event('change')), viewer.drawn")
    assert fresh.run("[viewer.state.view, viewer.methods[0].label]") == [0, "Truth, flat footprints"]
    picture = seen(VIEWS["One yarn"], SIZE, ENDS)
    shown, rays = (components(fresh, name)[picture.lit] for name in ("flat", "truth"))
    wanted = estimate(CLOTH, picture.queries, TruthOptions(relative_error=0.01, parallax=False), 0).mean
    assert np.abs(shown - wanted).max() < 1e-3 * wanted.max()  # half floats
    assert np.abs(shown - rays).max() > 0.05 * wanted.max()
    fresh.run("viewer.go(3)")
    assert "Truth, flat footprints: known at One yarn alone" in fresh.run("byId('notice').textContent")


# ---- keys, pointers, the page --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "modifiers", "name", "by"),
    [
        ("ArrowLeft", 0, "turn", -3), ("ArrowUp", 0, "tilt", 3), ("ArrowRight", 8, "lightTurn", 5),
        ("ArrowDown", 8, "lightTilt", -5), ("[", 0, "wipe", -0.02),
    ],
)  # fmt: skip
def test_keys_move(fresh, key, modifiers, name, by):
    before = fresh.run(f"byId('cloth').focus(), viewer.state.{name}")
    fresh.call("Input.dispatchKeyEvent", type="keyDown", key=key, modifiers=modifiers)
    assert fresh.run(f"viewer.state.{name}") == pytest.approx(before + by)


def test_dragging_shows_a_coarse_picture_and_ends_at_a_full_one(fresh):
    before = fresh.run("viewer.drawn.then(() => viewer.state.turn)")
    watch = "new MutationObserver(() => seen.push(document.body.className))"
    fresh.run(f"window.seen = [], {watch}.observe(document.body, {{ attributes: true }})")
    for kind, x, buttons in (("mousePressed", 100, 1), ("mouseMoved", 130, 1), ("mouseReleased", 130, 0)):
        fresh.call("Input.dispatchMouseEvent", type=kind, x=x, y=100, button="left", buttons=buttons)
    assert fresh.run("viewer.drawn.then(() => viewer.state.turn)") == pytest.approx(before - 10)
    assert fresh.run("[seen[0], seen.at(-1)]") == ["coarse", "full"]
    assert f", {fresh.run('viewer.canvas.width')} × " in fresh.run("byId('speed').textContent")


def test_two_fingers_zoom(fresh):
    before = fresh.run("viewer.state.distance")
    for kind, points in (("touchStart", [(100, 100), (150, 100)]), ("touchMove", [(75, 100), (175, 100)])):
        fresh.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y} for x, y in points])
    assert fresh.run("viewer.state.distance") < 0.7 * before
    fresh.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])


def test_every_control_has_a_name_and_takes_the_focus(page):
    nameless = """[...document.querySelectorAll("input, select, button, canvas")].filter(element =>
        !(element.getAttribute("aria-label") || element.textContent.trim() || element.closest("label"))
        || element.tabIndex < 0).map(element => element.outerHTML)"""
    assert page.run(nameless) == [] and page.run("document.querySelectorAll('[data-name]').length") >= 20


def test_without_webgl_a_still_picture_and_a_sentence(whole, tmp_path):
    without = "HTMLCanvasElement.prototype.getContext = () => null"
    with viewer(whole, tmp_path, before=without) as own:
        assert own.run("byId('notice').textContent") == ("This is a still picture: This browser has no WebGL 2.")
        assert own.run("byId('still').getBoundingClientRect().width * byId('still').naturalWidth") > 0
        assert own.run("getComputedStyle(byId('panel')).display") == "none" and own.errors == []


def test_nothing_is_written_to_the_console_and_nothing_is_asked_for(page):
    """The last test: it sees what all others did."""
    assert page.errors == []
    assert all(address.startswith(("file:", "data:")) for address in page.requests) and len(page.requests) >= 1
