"""The file that `twillight view` writes, its parts, and the sentences for what cannot be shown."""

import fnmatch
import json
import re
import tomllib
from pathlib import Path

import pytest

from jobs.cli import main
from jobs.verbs.exchange.shader.languages import slangc
from jobs.verbs.exchange.viewer import view
from jobs.verbs.exchange.viewer.content import BENDS, NARROWER, VIEWS, WIDTHS, bends, bent, widths
from jobs.verbs.exchange.viewer.generate import SHADER, mark, shader, sources
from jobs.verbs.exchange.viewer.view import whole_page
from tests.jobs.verbs.exchange.viewer.conftest import opened, write
from tests.jobs.verbs.exchange.viewer.test_viewer import assert_equal, components, expected
from weaves.fabric import load_fabric, preset_names

ROOT = Path(__file__).parents[5]


def test_the_shader_is_made_of_its_source():
    assert mark(sources()) in SHADER.read_text(encoding="utf-8"), "run `make viewer-shader`"


def test_slangc_makes_the_shader_again():
    if slangc() is None:
        pytest.skip("slangc is not installed")
    assert shader(sources()) == SHADER.read_text(encoding="utf-8"), "run `make viewer-shader`"


def test_an_installed_package_has_all_files_of_the_page():
    patterns = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]["jobs"]
    folder = Path(view.__file__).parent
    files = [path.relative_to(ROOT / "jobs") for path in folder.iterdir() if path.is_file() and path.suffix != ".py"]
    assert len(files) >= 7
    assert [path for path in files if not any(fnmatch.fnmatch(str(path), pattern) for pattern in patterns)] == []


def test_the_page_is_one_file_without_addresses(small):
    text = whole_page(small)
    assert "{{" not in re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert not re.search(r"https?://", text) and "default-src 'none'" in text
    content = json.loads(re.search(r'id="content">(.*?)</script>', text, re.S)[1])
    assert content["fabric"] == "gingham" and len(content["views"]) == 5


@pytest.mark.parametrize("name", preset_names())
def test_factors_keep_yarns_within_their_ranges(name):
    fabric = load_fabric(name)
    assert bends(fabric) in ((1.0,), BENDS[:2], BENDS) and widths(fabric) in (WIDTHS, NARROWER)
    for bend in bends(fabric):
        for width in widths(fabric):
            for yarn in (bent(fabric, bend, width).warp, bent(fabric, bend, width).weft):
                type(yarn).model_validate(yarn.model_dump())


@pytest.mark.parametrize(
    ("tokens", "allowed"),
    [
        (("--out", "x.htm"), "a path that ends in .html is needed"),
        (("--out", "x.html", "--truth", "5"), "must be from 8 to 512, or 0 for none"),
        (("--out", "x.html", "--truth", "-1"), "must be from 8 to 512, or 0 for none"),
    ],
)
def test_bad_input_is_one_sentence(capsys, monkeypatch, tmp_path, tokens, allowed):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["view", "gingham", *tokens]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and allowed in said and not list(tmp_path.iterdir())


def test_a_large_repeat_is_refused_before_any_work(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(view, "MOST_CELLS", 3)
    monkeypatch.setattr(view, "content", None)
    assert main(["view", "gingham", "--out", str(tmp_path / "x.html")]) == 2
    assert "at most 3 cells" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_a_page_is_written_whole(capsys, monkeypatch, tmp_path, small):
    monkeypatch.setattr(view, "content", lambda fabric, truth: small)
    assert main(["view", "gingham", "--out", str(tmp_path / "a" / "x.html")]) == 0
    assert "5 views" in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["x.html"]


def test_a_page_draws_what_python_does(small, tmp_path):
    """The one test of the browser that is not slow."""
    with opened(write(small, tmp_path), tmp_path / "profile") as page:
        page.run("viewer.go(3)")
        assert_equal(components(page, 2), expected(load_fabric("gingham"), VIEWS["Sphere"], 2))
        assert page.errors == [] and all(address.startswith(("file:", "data:")) for address in page.requests)
