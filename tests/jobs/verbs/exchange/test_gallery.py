import re
import shutil

import pytest

import jobs.verbs.show
import reports.exports.gallery
from reports.exports.gallery import FIBRES, Card, gallery_page
from tests.browser import opened
from weaves.fabric import load_fabric


def test_the_site_has_every_file_that_it_names(twillight, refused, monkeypatch, tmp_path):
    def export(fabric, kind, path, **options):
        files = {"maps": ("sample.glb", "maps.json"), "shader": ("soft_nodes.json",), "viewer": ("",)}[kind]
        for file in files:
            (path / file).parent.mkdir(parents=True, exist_ok=True)
            (path / file).write_text(f"{kind} of {fabric.name}: {options}")

    def swatch(fabric, folder, size):
        (path := folder / f"{fabric.name}-swatch.png").write_bytes(b"")
        return path

    monkeypatch.setattr(reports.exports.gallery, "export", export)
    monkeypatch.setattr(jobs.verbs.show, "write_swatch", swatch)
    own = load_fabric("gauze").model_copy(update={"name": "own", "source": "<b>mine</b>"})
    (tmp_path / "own.toml").write_text(own.to_toml(), encoding="utf-8")
    code, text, _ = twillight("gallery", "voile", "own.toml", "--out", "site", "--size", "64", "--language", "glsles")
    site = tmp_path / "site"
    assert code == 0 and "2 fabrics" in text and load_fabric(site / "own" / "own.toml") == own
    page = (site / "index.html").read_text(encoding="utf-8")
    named = re.findall(r'(?:href|src)="([^":]+)"', page)
    assert {(site / name).is_file() for name in named} == {True} and len(set(named)) == 12
    assert {path.name for path in site.rglob("*")} >= {"picture.png", "own-maps.zip", "voile-shader.zip"}
    assert "&lt;b&gt;mine" in page and "cotton" in page and "http" not in page
    shutil.unpack_archive(site / "own" / "own-maps.zip", tmp_path)
    assert "64" in (tmp_path / "own-maps" / "maps.json").read_text()
    shutil.copyfile("own.toml", "two.toml")
    assert "same name" in refused("gallery", "two.toml", "own.toml", "--out", "x")

    def stopped(fabric, folder, size):
        if fabric.name == "own":
            raise KeyboardInterrupt
        return swatch(fabric, folder, size)

    monkeypatch.setattr(jobs.verbs.show, "write_swatch", stopped)
    assert twillight("gallery", "voile", "own.toml", "--out", "part", "--size", "64")[0] != 0
    page = (tmp_path / "part" / "index.html").read_text(encoding="utf-8")
    assert "voile/voile.toml" in page and "own/own.toml" not in page


@pytest.mark.external
def test_the_page_searches_by_weave_and_fibre_and_opens_from_a_folder(tmp_path):
    cards = [
        Card(name, load_fabric(name).weave.name, (2, 2), (fibre,), "", (("live page", f"{name}/live.html", 1),))
        for fibre, names in FIBRES.items()
        for name in names
    ]
    (tmp_path / "index.html").write_text(gallery_page(cards), encoding="utf-8")
    for card in cards:
        (tmp_path / card.name).mkdir()
        shutil.copyfile("docs/pictures/presets/denim-swatch.png", tmp_path / card.name / "picture.png")
    shown = (
        "[...document.querySelectorAll('article')].filter(a => !a.hidden).map(a => a.querySelector('h2').textContent)"
    )
    press = "[...document.querySelectorAll('button')].find(b => b.textContent === '{}').click()"
    address = f"file://{tmp_path}/index.html"
    with opened(address, tmp_path / "profile", ready="document.getElementById('count')?.textContent") as page:
        assert len(page.run(shown)) == len(cards)
        page.run(press.format("satin"))
        assert page.run(shown) == ["satin 8", "silk charmeuse"]
        page.run(press.format("wool"))
        assert page.run(shown) == [] and page.run("document.getElementById('count').textContent").startswith("0 of")
        page.run(press.format("satin"))
        assert len(page.run(shown)) == len(FIBRES["wool"])
        page.run("find.value = 'DENIM'; find.oninput()")
        assert page.run(shown) == ["denim"]
        assert not page.errors and all(request.startswith(("file:", "data:")) for request in page.requests)
