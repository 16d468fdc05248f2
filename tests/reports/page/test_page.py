from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import urlparse

import matplotlib.image
import numpy as np
import pandas as pd
import pytest

from reports.images.exr import frame_layers, write_exr
from reports.measure.latents import SHARES
from reports.measure.pictures import write_picture
from reports.measure.scene.image_error import image_errors
from reports.measure.scene.scene_errors import difference_maps
from reports.options import BenchOptions, SceneBenchOptions
from reports.page.content import ModelNote, PageInput, PictureFile
from reports.page.files import read_files
from reports.page.page import write_page
from reports.page.pictures import FRAME_GAP
from reports.record import OF_A_PAGE, Record, read_machine, read_records, this_machine
from reports.truth import accuracy, bias, effort
from reports.truth.finding import RECORDS, judge
from weaves.fabric import load_fabric

VOID = {"meta", "img", "source", "link", "br", "hr", "input"}


class Page(HTMLParser):
    """Collects what a page refers to and checks that its tags nest."""

    def __init__(self, text):
        super().__init__()
        self.stack, self.files, self.targets, self.ids, self.text, self.tags = [], [], [], [], [], []
        self.feed(text)
        assert self.stack == []

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.append(tag)
        if tag not in VOID:
            self.stack.append(tag)
        self.ids += [attributes["id"]] if "id" in attributes else []
        for link in (attributes.get(name) for name in ("src", "srcset", "href")):
            if link is not None:
                (self.targets if link.startswith("#") else self.files).append(link)
        if tag == "img":
            assert "alt" in attributes

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag

    def handle_data(self, data):
        if not self.stack or self.stack[-1] not in ("style", "title", "script"):
            self.text.append(data)

    @property
    def words(self):
        return " ".join("".join(self.text).split()).replace("\u00a0", " ")


@pytest.fixture(scope="module")
def page_input(made_up, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    random = np.random.default_rng(0)
    pictures = []
    for fabric in ("denim", "basket", "twill_4_4"):
        for scene in ("sphere", "plane"):
            for method, setting in (("truth", ""), ("woven", ""), ("point_sampled", "k = 2")):
                path = folder / f"{fabric}-{scene}-{method}.exr"
                planes = {name: random.random((12, 16)) for name in "RGB"} | {"A": np.ones((12, 16))}
                write_exr(path, planes)
                pictures.append(PictureFile(fabric, scene, method, setting, path))
    live = folder / "live-denim-01234567.html"
    live.write_bytes(b"<title>denim</title>")
    danger = load_fabric("denim").model_copy(update={"source": "<script>alert('cloth')</script> & more"})
    return PageInput(
        recipe="tiny",
        about="Two fabrics and one unseen.",
        fingerprint="fedcba9876543210",
        dataset="tiny-01234567",
        fabrics=[(danger, "seen"), (load_fabric("basket"), "seen"), (load_fabric("twill_4_4"), "unseen")],
        models=[
            ModelNote("woven", "one network for all fabrics", "0011223344556677"),
            ModelNote("neumip", "one for each fabric", per_material=True),
            ModelNote("point_sampled", "nothing is trained"),
        ],
        options=BenchOptions(),
        records=made_up,
        machine=this_machine(1),
        pictures=pictures,
        live={"denim": live},
    )


@pytest.fixture(scope="module")
def written(page_input, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    shares = []
    index = write_page(folder, page_input, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] <= 1
    return folder, Page(index.read_text(encoding="utf-8"))


@pytest.fixture
def undrawn(monkeypatch):
    """Leave plots empty: they take most of the time of a page, and tests of words and tables do not look at them."""
    monkeypatch.setattr("reports.page.page.render", lambda plot, scheme, *data: b"")


def test_page_is_whole_and_needs_nothing_else(written):
    folder, page = written
    assert page.files
    for link in page.files:
        assert not urlparse(link).scheme
        assert (folder / link).is_file(), link
    assert {target.removeprefix("#") for target in page.targets} <= set(page.ids)
    assert page.tags.count("script") == 1  # without a source
    assert "url(" not in (folder / "index.html").read_text()


def test_every_figure_is_shown(written):
    folder, page = written
    made = {f"figures/{path.name}" for path in (folder / "figures").iterdir()}
    assert made - set(page.files) == {"figures/overview.png"}  # the sheet is for the README


def test_live_pages_are_beside_the_page(written):
    folder, page = written
    assert (folder / "live" / "denim.html").read_bytes() == b"<title>denim</title>"
    assert "live/denim.html" in page.files and "live/denim.html" in read_files(folder)


def test_headline_prints_the_papers_comparison(written):
    """Made up: woven errs 1/9 of one point, 2 points 1/2: 4.5 times lower; it costs 3600 ns to their 830."""
    words = written[1].words
    assert (
        "Woven reaches 4.5× lower MSE than point sampling at 2 points on the 2 seen fabrics and 4.5× lower MSE on one "
        "unseen fabric, at 4.3× its time; the paper reports 4.1× at 0.83× on its own scene and GPU." in words
    )
    assert "NeuMIP is trained on every fabric by itself" in words
    assert "Point sampling at 2 points answers 0 for 15% of the queries" in words


def test_the_front_is_named_and_shown(written):
    """Made up: errors are the root of 2e-3 or 1.5e-3 over k, so that 64 points err half a percent."""
    folder, page = written
    assert "cheapest within 10 %" in page.words and ": points, k = 1 (" in page.words
    assert "Front of error and time, seen fabrics" in page.words and "Not on the front: NeuMIP." in page.words
    front = pd.read_csv(folder / "tables" / "tradeoff.csv")
    assert set(front.loc[~front["front"], "method"]) == {"neumip"}


@pytest.mark.usefixtures("undrawn")
def test_methods_that_learn_nothing_make_no_headline(page_input, tmp_path):
    note = ModelNote("woven", "a rule", kind="soft_nodes")
    models = [note, *page_input.models[1:]]
    page = Page(write_page(tmp_path, replace(page_input, models=models)).read_text(encoding="utf-8"))
    assert "Woven reaches" not in page.words and "NeuMIP reaches" in page.words


@pytest.mark.usefixtures("undrawn")
def test_silhouettes_are_shown_where_they_were_measured(written, page_input, tmp_path):
    assert "silhouettes" not in written[1].ids and "#silhouettes" not in written[1].targets
    subject = Record(method="curved", fabric="denim", role="seen")
    numbers = {"silhouette_coverage": 0.125, "silhouette_displacement": -0.03, "silhouette_light": 0.25}
    more = [subject.of(name, value, 100) for name, value in numbers.items()]
    page = Page(write_page(tmp_path, replace(page_input, records=[*page_input.records, *more])).read_text())
    assert "silhouettes" in page.ids and "#silhouettes" in page.targets
    assert "curved.125−0.0300.2501" in page.words.replace(" ", "")


def test_page_says_what_it_is_made_of(written, page_input):
    words = written[1].words
    for fact in ("fedcba9876543210", "tiny-01234567", "0011223344556677", page_input.machine.cpu, "1.51 %"):
        assert fact in words


def test_page_keeps_its_records_and_the_machine_of_the_times(written, page_input, made_up):
    folder, _ = written
    assert read_records([folder / OF_A_PAGE]) == made_up
    assert read_machine(folder / OF_A_PAGE).model_copy(update={"sha256": ""}) == page_input.machine


def test_text_of_files_is_escaped(written):
    assert "<script>alert('cloth')</script> & more" in written[1].words


def test_tables_hold_the_records(written, made_up):
    folder, _ = written
    table = pd.read_csv(folder / "tables" / "records.csv")
    assert len(table) == len(made_up)
    assert table["value"].to_numpy() == pytest.approx([record.value for record in made_up])
    for name in ("errors", "errors_by_fabric", "pictures", "aliasing", "timing"):
        csv, parquet = (folder / "tables" / f"{name}.{kind}" for kind in ("csv", "parquet"))
        assert list(pd.read_csv(csv)) == list(pd.read_parquet(parquet))


@pytest.mark.slow
def test_the_same_records_give_the_same_bytes(written, page_input, tmp_path):
    def content(folder: Path):
        return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}

    write_page(tmp_path, page_input)
    assert content(tmp_path) == content(written[0])


def test_a_page_of_nothing_claims_nothing(page_input, tmp_path):
    empty = PageInput(**{**page_input.__dict__, "records": [], "pictures": []})
    page = Page(write_page(tmp_path, empty).read_text(encoding="utf-8"))
    assert "reaches" not in page.words
    assert "4.1" not in page.words
    assert "Two fabrics and one unseen." in page.words
    assert all((tmp_path / link).is_file() for link in page.files)


@pytest.mark.usefixtures("undrawn")
def test_stability_is_shown_where_it_was_measured(written, page_input, tmp_path):
    assert "stability" not in written[1].ids
    assert "#stability" not in written[1].targets
    findings = [
        judge("σ", "near <the> axis", "float32", {"w": [0.25]}, [1.0], [1.0], 1e-6, naive=[1.001]),
        judge("f_t", "equal Λ", "float64", {"w": [0.5]}, [1.5], [1.0], 1e-15, naive=[np.nan]),
    ]
    more = PageInput(**{**page_input.__dict__, "records": [*page_input.records, *RECORDS.to_records(findings)]})
    page = Page(write_page(tmp_path, more).read_text(encoding="utf-8"))
    assert "stability" in page.ids
    assert "#stability" in page.targets
    words = page.words.replace(" ", "")
    assert "float32σnear<the>axis0.00e01.00e−61.00e−3000ok" in words
    assert "float64f_tequalΛ5.00e−11.00e−150.00e0001worsterror" in words
    assert len(pd.read_csv(tmp_path / "tables" / "stability.csv")) == 2
    # Nothing else on the page takes the two arithmetics for methods.
    assert page.words.count("float32") == 1


@pytest.mark.usefixtures("undrawn")
def test_methods_at_their_extremes_are_shown_and_what_was_not_run_is_said(page_input, tmp_path):
    subject = Record(method="woven", setting="eager-bf16")
    records = [
        subject.of("extreme_error", 0.5, 90, curve=((1e-4, 0.5), (1.0, 0.125))),
        subject.of("extreme_rounding", 0.004, 90),
        subject.of("extreme_not_finite", 3.0, 180),
        subject.of("extreme_negative", 0.0, 180),
        Record(method="woven", setting="compile", metric="not_run", value=1.0, note="no <compiler>"),
    ]
    more = PageInput(**{**page_input.__dict__, "records": [*page_input.records, *records]})
    page = Page(write_page(tmp_path, more).read_text(encoding="utf-8"))
    assert "stability" in page.ids and "#stability" in page.targets
    words = page.words.replace(" ", "").replace("\N{NO-BREAK SPACE}", "")
    assert "50.0%–12.5%––––4.0e-03––3of180✗0" in words
    assert "woven by compile was not measured (no <compiler>)." in page.words
    assert len(pd.read_csv(tmp_path / "tables" / "extremes.csv")) == 1


@pytest.mark.usefixtures("undrawn")
def test_what_lies_between_fabrics_is_shown_where_it_was_measured(written, page_input, tmp_path):
    assert "latents" not in written[1].ids and "#latents" not in written[1].targets
    subject = Record(method="woven", fabric="denim")
    path = subject.model_copy(update={"note": "yarns of satin_8"})
    curve = tuple(zip(SHARES, (0.01, 0.15, 0.2, 0.1, 0.02), strict=True))
    records = [path.of("path_error", 0.2, 64, curve=curve), path.of("reencode_error", 0.2, 64, curve=curve[::-1])]
    edit = subject.model_copy(update={"note": "a colour"})
    records.append(edit.of("encode_time", 0.25, 25, low=0.24, high=0.31))
    more = PageInput(**{**page_input.__dict__, "records": [*page_input.records, *records]})
    page = Page(write_page(tmp_path, more).read_text(encoding="utf-8"))
    assert "latents" in page.ids and "#latents" in page.targets
    words = page.words.replace(" ", "")
    assert "denim→yarnsofsatin8latentsblended1.0%15.0%20.0%10.0%2.0%" in words
    assert "denim→yarnsofsatin8encodedanew2.0%10.0%20.0%15.0%1.0%" in words
    assert "acolour0.25ms0.24…0.31" in words
    table = pd.read_csv(tmp_path / "tables" / "between.csv")
    assert table["share"].tolist() == [*SHARES, *SHARES[::-1]]


@pytest.mark.usefixtures("undrawn")
def test_what_accuracy_costs_is_shown_where_it_was_measured(written, page_input, tmp_path):
    assert "accuracy" not in written[1].ids
    accuracies = [
        accuracy.Accuracy(f"{name} points", fabric, 0.05, error, 0.03, 64.0, 5000.0, saved, 0.0007, 150)
        for fabric in ("denim", "twill_4_4")
        for name, error, saved in (("mc, 64", 0.08, 1.0), ("owen, 64", 0.04, 4.2))
    ]
    biases = [
        bias.Bias("denim", side, component, value, 0.0005, 900)
        for side in bias.SIDES
        for component, value in (("specular_warp", -0.001), ("diffuse_weft", 0.006), ("diffuse_warp", 0.0025))
    ]
    efforts = [
        effort.Effort("table alone", "denim", 0.75, 4000.0, 2e-5, 900),
        effort.Effort("sampled", "denim", 0.25, 9000.0, 2e-3, 900),
    ]
    records = [*page_input.records, *accuracy.RECORDS.to_records(accuracies), *bias.RECORDS.to_records(biases)]
    more = PageInput(**{**page_input.__dict__, "records": [*records, *effort.RECORDS.to_records(efforts)]})
    page = Page(write_page(tmp_path, more).read_text(encoding="utf-8"))
    assert "accuracy" in page.ids and "#accuracy" in page.targets
    assert "150 queries a fabric" in page.words and "a stated error of 0.07 %" in page.words
    words = page.words.replace(" ", "")
    assert "denimowen,64points5.00%4.00%3.00%645,0004.2×0.07%" in words
    assert all(
        text in words for text in ("specularwarp−0.10%0.05%✓", "diffusewarp0.25%0.05%", "diffuseweft0.60%0.05%✗")
    )
    assert "denimtablealone75.0%4,00020.0µs3%" in words and "denimsampled25.0%9,0002.00ms97%" in words
    assert len(pd.read_csv(tmp_path / "tables" / "truth_accuracy.csv")) == 4
    assert all((tmp_path / link).is_file() for link in page.files)
    # Nothing else on the page takes them for rates or for methods.
    assert "rates" not in page.ids and page.words.count("owen, 64 points") == 2


@pytest.fixture
def scenes(tmp_path):
    """A page of one scene: three frames by the truth, by a method and by the baseline, which nobody else measured."""
    random = np.random.default_rng(2)
    truth = 0.1 + random.random((3, 24, 32, 3))
    lit = np.ones((24, 32), bool)
    lit[:6] = False
    pictures, records = [], []
    for method, setting, factor in (("truth", "", 1.0), ("woven", "", 1.08), ("point_sampled", "k = 2", 0.6)):
        path, layers = tmp_path / f"{method}.exr", frame_layers(factor * truth)
        if method != "truth":
            found = image_errors(factor * truth[0], truth[0], 0.01 * truth[0], lit)
            layers |= difference_maps(factor * truth[0], truth[0], found)
            subject = Record(method=method, setting=setting, scene="attic")
            records += [*found.records(subject), subject.of("frame_time", 20.0 * factor, 25)]
            records += [subject.of("colour_rrmse", abs(factor - 1), 900), subject.of("flicker", factor - 1, 3)]
        write_picture(path, factor * truth[0], np.ones_like(lit), {}, layers=layers)
        pictures.append(PictureFile("", "attic", method, setting, path))
    options = BenchOptions(scenes=SceneBenchOptions(names=("attic",), frames=3))
    models = [ModelNote("woven", "one network"), ModelNote("point_sampled", "nothing is trained")]
    return PageInput("tiny", "", "0123", "tiny-0123", [], models, options, records, this_machine(1), pictures)


def test_scenes_show_intervals_noise_frames_and_maps(scenes, tmp_path):
    page = Page(write_page(tmp_path / "page", scenes).read_text(encoding="utf-8"))
    assert "scenes" in page.ids
    assert all((tmp_path / "page" / link).is_file() for link in page.files)
    stem = "figures/scene-attic-point_sampled-k-2"
    assert {"figures/film-attic.png", f"{stem}-flip.png", f"{stem}-relative.png"} <= set(page.files)
    # Three frames of 32 pixels and their slice over time, all twice as large.
    film = matplotlib.image.imread(tmp_path / "page" / "figures" / "film-attic.png")
    assert film.shape[:2] == (2 * (3 * 24 + 2 * FRAME_GAP), 2 * (4 * 32 + 5 * FRAME_GAP))
    # Rows are the truth, woven, which is brighter, and points.
    rows = film[::2, ::2, :3]
    truth, woven, points = (rows[top : top + 24, :32].mean() for top in (0, 24 + FRAME_GAP, 2 * (24 + FRAME_GAP)))
    assert points < truth < woven
    words = page.words
    assert "cheapest within 10 %: woven (21.6 ms); no method reaches 5 % or 2 %" in words
    assert "noise of the truth" in words and "frame 3" in words and "frame 4" not in words
    assert "pyfvvdp was not installed" in words


@pytest.mark.usefixtures("undrawn")
def test_the_same_scenes_give_the_same_tables(scenes, tmp_path):
    for name in ("one", "two"):
        write_page(tmp_path / name, scenes)
    for path in sorted((tmp_path / "one").rglob("*.*")):
        if path.suffix in (".csv", ".parquet", ".png", ".html"):
            assert path.read_bytes() == (tmp_path / "two" / path.relative_to(tmp_path / "one")).read_bytes(), path
    table = pd.read_csv(tmp_path / "one" / "tables" / "scenes.csv").set_index("method")
    assert (table["mse_low"] <= table["mse"]).all() and (table["mse"] <= table["mse_high"]).all()
    assert table["flip_ldr_floor"].nunique() == 1 and (table["flip_ldr_floor"] > 0).all()
