import fnmatch
import json
import re
import tomllib
from pathlib import Path

import pytest

from pipeline.shader.languages import slangc
from reports.viewer import view
from reports.viewer.generate import SHADERS, mark, shader, shipped, sources
from reports.viewer.view import BEND_FACTORS, NARROWER, VIEWS, WIDTHS, bends, bent, whole_page, widths
from tests.presets import PRESETS
from tests.reports.viewer.conftest import viewer
from tests.reports.viewer.test_viewer import assert_equal, components, expected
from weaves.fabric import load_fabric

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("name", SHADERS)
def test_the_shaders_are_made_of_their_source(name):
    assert mark(sources()) in shipped(name), "run `make viewer-shader`"


@pytest.mark.external
@pytest.mark.parametrize("name", SHADERS)
def test_slangc_makes_the_shaders_again(name):
    if slangc() is None:
        pytest.skip("slangc is not installed")
    assert shader(name, sources()) == shipped(name), "run `make viewer-shader`"


def test_an_installed_package_has_all_files_of_the_page():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]["reports"]
    folder = Path(view.__file__).parent
    files = [path.relative_to(ROOT / "reports") for path in folder.iterdir() if path.is_file() and path.suffix != ".py"]
    assert len(files) >= 7
    assert [path for path in files if not any(fnmatch.fnmatch(str(path), pattern) for pattern in patterns)] == []


def test_the_page_is_one_file_without_addresses(small):
    text = whole_page(small)
    assert "{{" not in re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert not re.search(r"https?://", text) and "default-src 'none'" in text
    content = json.loads(re.search(r'id="content">(.*?)</script>', text, re.S)[1])
    assert content["fabric"] == "gingham" and len(content["views"]) == 5


@pytest.mark.parametrize("name", PRESETS)
def test_factors_keep_yarns_within_their_ranges(name):
    fabric = load_fabric(name)
    assert bends(fabric) in ((1.0,), BEND_FACTORS[:2], BEND_FACTORS) and widths(fabric) in (WIDTHS, NARROWER)
    for bend in bends(fabric):
        for width in widths(fabric):
            for yarn in (bent(fabric, bend, width).warp, bent(fabric, bend, width).weft):
                type(yarn).model_validate(yarn.model_dump())


@pytest.mark.external
def test_a_page_draws_what_python_does(small, tmp_path):
    """The one test of the browser that is not slow."""
    with viewer(small, tmp_path) as page:
        page.run("viewer.go(3)")
        assert_equal(components(page, 2), expected(load_fabric("gingham"), VIEWS["Sphere"], 2))
        assert page.errors == [] and all(address.startswith(("file:", "data:")) for address in page.requests)


OVER = """[...document.querySelectorAll("input, select, button, #labels, #readings")].filter(element => {
    const [a, b] = [byId("picture"), element].map(part => part.getBoundingClientRect());
    return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}).map(element => element.outerHTML)"""
CUT = """[...document.querySelectorAll("button, dd, .range span, .range output, .side, #labels span")]
    .filter(element => element.scrollWidth > element.clientWidth + 1 && element.clientWidth > 0)
    .map(element => element.textContent)"""


@pytest.mark.external
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1400, 900, 0.25), (390, 844, 0.5)])
def test_a_page_is_whole_and_silent_on_screens_of_all_kinds(small, tmp_path, size, scheme):
    with viewer(small, tmp_path, size=size, scheme=scheme) as page:
        ground = page.run("getComputedStyle(document.documentElement).backgroundColor.match(/[0-9]+/g).map(Number)")
        assert (min(ground) > 200) == (scheme == "light")
        page.run("viewer.measure()")
        assert page.run("byId('error').textContent").endswith("% of the mean colour")
        assert page.run(OVER) == [] and page.run(CUT) == []
        assert page.run("document.documentElement.scrollWidth") == size[0]
        names = page.run("[...document.querySelectorAll('button')].map(element => element.textContent)")
        assert len(set(names)) == len(names) > 5
        assert page.messages == []
