import itertools
import re
from dataclasses import replace
from urllib.parse import urlparse

import matplotlib.image
import pandas as pd
import pytest

from pipeline.models.added.added_code import ADDED_MODEL
from reports.images.tiles import hex_colour, size_of
from reports.measure.latents import SHARES
from reports.page import figures
from reports.page.colours import DARK, LIGHT
from reports.page.content import ModelNote
from reports.page.figures import render
from reports.page.files import read_files
from reports.page.html import FIRST_SIGHT, OPEN_ROWS, fabric_card, page_html, prose, schemes
from reports.page.page import write_page
from reports.page.pictures import FRAME_GAP
from reports.record import OF_A_PAGE, read_machine, read_records
from reports.tables import summary
from reports.tables.page_tables import page_frames
from reports.tables.table import WORDS
from tests.reports.page.conftest import Reader
from weaves.colour import EXPOSURE
from weaves.fabric import load_fabric


@pytest.fixture(scope="module")
def sizes(folder):
    return {path.name: size_of(path.read_bytes()) for path in (folder / "figures").iterdir()}


def test_a_page_is_whole_with_plots_on_a_clear_ground(folder, page):
    assert not [link for link in page.files if urlparse(link).scheme or not (folder / link).is_file()]
    assert set(page.targets) <= set(page.ids) and len(set(page.ids)) == len(page.ids)
    (script,) = page.all("script")
    assert "src" not in script and "url(" not in (folder / "index.html").read_text()
    made = {f"figures/{path.name}" for path in (folder / "figures").iterdir()}
    assert made <= set(page.files)
    assert (folder / "live" / "denim.html").read_bytes() == b"<title>denim</title>"
    assert "live/denim.html" in page.files and "live/denim.html" in read_files(folder)
    for name, scheme in itertools.product(WORDS["plots"], ("light", "dark")):
        picture = matplotlib.image.imread(folder / "figures" / f"{name}-{scheme}.png")
        assert picture.shape[1] > 1500 and picture[0, 0, 3] == 0, name
        assert (picture[..., 3] == 1).mean() > 0.002, name


def test_equal_data_give_equal_bytes_and_records_and_their_machine_are_kept(folder, page_input):
    timing = summary.timing_table(page_input.records)
    for name, scheme in schemes(page_input).items():
        drawn = render(figures.timing, scheme, timing)
        assert drawn == (folder / "figures" / f"timing-{name}.png").read_bytes() and b"Software" not in drawn
    assert read_records([folder / OF_A_PAGE]) == page_input.records
    machine = read_machine(folder / OF_A_PAGE)
    assert machine.model_copy(update={"sha256": ""}) == page_input.machine
    table = pd.read_csv(folder / "tables" / "records.csv")
    assert table["value"].to_numpy() == pytest.approx([record.value for record in page_input.records])
    assert {"dataset", "seed", "threads"} < {*table} and {"curve", "samples"}.isdisjoint(table)
    for csv in (folder / "tables").glob("*.csv"):
        assert list(pd.read_csv(csv)) == list(pd.read_parquet(csv.with_suffix(".parquet")))


@pytest.mark.slow
def test_the_same_records_give_the_same_bytes(folder, page_input, tmp_path):
    write_page(tmp_path, page_input)
    first, second = (
        {path.relative_to(where): path.read_bytes() for path in where.rglob("*.*")} for where in (folder, tmp_path)
    )
    assert first == second


def test_the_headline_and_the_front(folder, page):
    """Made up: woven errs 1/9 of one point, 2 points 1/2: 4.5 times lower; it costs 3600 ns to their 830.

    Errors are the root of 2e-3 or 1.5e-3 over k, so that 64 points err half a percent."""
    for sentence in (
        "Woven reaches 4.5× lower MSE than point sampling at 2 points on the 2 seen fabrics, at 4.3× its time, and "
        "4.5× lower MSE on one unseen fabric; the paper reports 4.1× at 0.83× without our changes, in a picture of its "
        "own scene, on a GPU.",
        "On the fronts of unseen fabrics",
        "NeuMIP is trained on every fabric by itself",
        "Point sampling at 2 points answers 0 for 15% of the queries",
        "Front of error and time, seen fabrics",
        "Not on the front: NeuMIP.",
        ": points, k = 1 (",
    ):
        assert sentence in page.words
    front = pd.read_csv(folder / "tables" / "tradeoff.csv")
    assert set(front.loc[~front["front"], "method"]) == {"neumip"}


def test_every_section_shows_its_numbers_and_what_they_are_made_of(folder, page, page_input):
    """Sections in their order, each in the navigation, and a row of each table that no other test looks at."""
    made_of = ["fedcba9876543210", "tiny-01234567", "0011223344556677", page_input.machine.cpu, "1.51 %"]
    assert all(fact in page.words for fact in [*made_of, "<script>alert('cloth')</script> & more"])
    ids = [section["id"] for section in page.all("section")]
    assert ids == list(WORDS["sections"]) and set(ids) <= set(page.targets)
    words = page.words.replace(" ", "")
    texts = (
        "woven≤16k1,5005.0kB3002a<fast>laptop", "woven.125−0.0300.2501", "50.0%–12.5%––––4.0e-03––3of180✗0",
        "denim→yarnsofsatin8latentsblended1.0%15.0%20.0%10.0%2.0%",
        "denimrandomsamples5:30.3,500:17",
        "denim→yarnsofsatin8encodedanew2.0%10.0%20.0%15.0%1.0%", "acolour0.25ms0.24…0.31",
        "float32σnear<the>axis0.00e01.00e−61.00e−3000ok", "float64f_tequalΛ5.00e−11.00e−150.00e0001worsterror",
        "denimowen,64points5.00%4.00%3.00%645,0004.2×0.07%", "specularwarp−0.10%0.05%✓", "diffusewarp0.25%0.05%",
        "diffuseweft0.60%0.05%✗", "denimtablealone75.0%4,00020.0µs3%", "denimsampled25.0%9,0002.00ms97%",
        "drapesoftnodes:242.50e−31.50s3.2×", "denimlobes20×12×210900", "everything–4.5e+081fast",
        "largesterror,1/sr(lowerisbetter)woven25.0%",
    )  # fmt: skip
    assert [text for text in texts if text not in words] == []
    assert "150 queries a fabric" in page.words and "a stated error of 0.07 %" in page.words
    assert "woven by compile was not measured (no <compiler>)." in page.words
    assert "Largest error of all queries." in page.words
    # Nothing else on the page takes estimators and arithmetics for methods.
    assert page.words.count("owen, 64 points") == 2 and page.words.count("float32") == 1
    between, stability = (pd.read_csv(folder / "tables" / f"{name}.csv") for name in ("between", "stability"))
    assert between["share"].tolist() == [*SHARES, *SHARES[::-1]] and len(stability) == 2
    other = pd.read_csv(folder / "tables" / "other_metrics.csv").set_index("method")
    assert other.loc["woven", "added_largest_error"] == 0.25


def test_scenes_show_intervals_noise_frames_and_maps(folder, page):
    stem = "figures/scene-attic-point_sampled-k-2"
    assert {"figures/film-attic.png", f"{stem}-flip.png", f"{stem}-relative.png"} <= set(page.files)
    # Three frames of 32 pixels and their slice over time, all twice as large.
    film = matplotlib.image.imread(folder / "figures" / "film-attic.png")
    assert film.shape[:2] == (2 * (3 * 24 + 2 * FRAME_GAP), 2 * (4 * 32 + 5 * FRAME_GAP))
    # Rows are the truth, woven, which is brighter, and points.
    frames = film[::2, ::2, :3]
    truth, woven, points = (frames[top : top + 24, :32].mean() for top in (0, 24 + FRAME_GAP, 2 * (24 + FRAME_GAP)))
    assert points < truth < woven
    assert "cheapest within 10 %: woven (21.6 ms); no method reaches 5 % or 2 %" in page.words
    assert "noise of the truth" in page.words and "pyfvvdp was not installed" in page.words
    assert "frame 3" in page.words and "frame 4" not in page.words
    table = pd.read_csv(folder / "tables" / "scenes.csv").set_index("method")
    assert (table["mse_low"] <= table["mse"]).all() and (table["mse"] <= table["mse_high"]).all()
    assert table["flip_ldr_floor"].nunique() == 1 and (table["flip_ldr_floor"] > 0).all()


def test_a_page_of_nothing_claims_nothing(bare, tmp_path):
    page = Reader(write_page(tmp_path, bare).read_text(encoding="utf-8"))
    assert "reaches" not in page.words and "4.1" not in page.words and "Two fabrics and one unseen." in page.words
    assert all((tmp_path / link).is_file() for link in page.files)
    assert not (tmp_path / "tables" / "other_metrics.csv").exists()


def test_several_trainings_have_a_mean_and_a_range(bare, three_trainings, page, sizes):
    """MSE of 1, 2 and 3 parts of that of k = 9 on denim and basket, whose mean is 1.5e-3 / 9; 2 points have 7.5e-4.

    Tables of more rows than `OPEN_ROWS` are closed, and what learns nothing has no headline."""
    many = [
        record.model_copy(update={"setting": f"k = {100 + index}"})
        for record in three_trainings
        if (record.method, record.setting) == ("point_sampled", "k = 64")
        for index in range(OPEN_ROWS)
    ]
    content = replace(bare, records=[*three_trainings, *many])
    several = Reader(page_html(content, page_frames(content.records), sizes))
    for sentence in (
        "Woven reaches 2.2× lower MSE (1.5× to 4.5× over 3 trainings) than point sampling at 2 points",
        "3.33e−4(3.09 … 3.58)e−4[1.67 … 5.00]e−4",
        "2.2×(2 … 2.5×)[1.5 … 4.5×]",
        "Networks were trained up to 3 times",
        "Numbers of woven are means over 3 trainings",
        "One training of NeuMIP",
    ):
        assert sentence in several.words, sentence
    assert "NeuMIP reaches" not in several.words and "NeuMIP reaches" in page.words
    assert "trainings" not in page.words.partition("Definitions of the columns")[0]
    once, often = (
        {table["text"].strip() for table in part.all("caption") if table.get("class") == "hidden"}
        for part in (page, several)
    )
    assert "Times and storage" in often - once and any(text.startswith("Errors, seen fabrics") for text in often - once)
    assert {"silhouettes", "stability", "latents", "accuracy", "other", "live"}.isdisjoint(several.ids)


def test_a_method_from_outside_leads_and_no_other_papers_number_stands_beside_it(bare, made_up, sizes):
    """Made up: NeuMIP is at k = 9, 4.5 times below two points, and takes 3610 ns to their 830."""
    note = ModelNote("neumip", "a method of one's own", kind=ADDED_MODEL)
    records = [record for record in made_up if record.method != "woven"]
    content = replace(bare, models=[bare.models[2], note], records=records)
    page = Reader(page_html(content, page_frames(records), sizes))
    heading, lead, trade, *_ = [element["text"] for element in page.all("h1", "p") if "header" in element["within"]][1:]
    assert heading.startswith("NeuMIP on") and lead.startswith("NeuMIP reaches 4.5× lower MSE")
    assert trade.startswith("A pixel of two random points")
    values = [element["text"] for element in page.all("div") if element.get("class") == "value"]
    assert values == ["4.5×", "1.3 %", "4.3×", "3 %"]
    assert not any(words in page.words for words in ("its paper", "paper of", "dashed arrow", "Published figures"))


def test_every_picture_has_its_size_and_what_is_not_seen_at_first_can_be_opened(page, sizes):
    pictures = [picture for picture in page.all("img") if picture["src"].startswith("figures/")]
    assert len(pictures) > 20
    for picture in pictures:
        assert (int(picture["width"]), int(picture["height"])) == sizes[picture["src"].removeprefix("figures/")]
    closed = {section["id"] for section in page.all("section") if section.get("class") == "closed"}
    assert closed == set(WORDS["sections"]) - FIRST_SIGHT
    assert all("summary" in title["within"] for title in page.all("h2") if title["text"] == "Energy")


def test_plots_are_described_with_their_fronts_and_their_lowest_and_highest_values(page):
    """Made up: points of k cost 400 k and err 1/k; woven costs as points of 9; NeuMIP as woven, and is not faster."""
    texts = {picture["src"]: picture["alt"].replace("\u00a0", " ") for picture in page.all("img")}
    front, timing, errors = (texts[f"figures/{name}-light.png"] for name in ("error-against-time", "timing", "errors"))
    assert "On the front, seen fabrics: points, k = 1, points, k = 2" in front
    assert "woven" in front and "NeuMIP" not in front
    assert "Lowest: points, k = 1 (420 ns); highest: points, k = 64" in timing
    assert "Lowest, seen fabrics: points, k = 64" in errors


def test_headings_landmarks_and_names_of_everything(page):
    levels = [int(heading["tag"][1]) for heading in page.all("h1", "h2", "h3", "h4", "h5", "h6")]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))
    for tag in ("header", "nav", "main", "footer"):
        (landmark,) = page.all(tag)
        assert "main" not in landmark["within"]
    assert page.all("nav")[0]["aria-label"] and all("main" in section["within"] for section in page.all("section"))
    assert page.all("html")[0]["lang"] == "en" and page.all("title")[0]["text"]
    first, (main,) = page.all("a")[0], page.all("main")
    assert first["href"] == f"#{main['id']}" and first["class"] == "skip" and main["tabindex"] == "-1"
    # Headings, links, pictures, tables, and what scrolls; a link round a picture has the words of the picture.
    assert all(heading["text"].strip() for heading in page.all("h1", "h2", "h3", "caption"))
    assert all(link["text"].strip() or link["pictures"] for link in page.all("a", "button", "summary"))
    sources = {}
    for picture in page.all("img"):
        assert picture["alt"].strip()
        sources.setdefault(picture["alt"], set()).add(picture["src"])
    assert len(sources) > 20 and all(len(files) == 1 for files in sources.values()), "two pictures have the same words"
    assert len(page.all("table")) == len(page.all("caption")) > 8
    assert all(head["scope"] in ("col", "row", "rowgroup") and head["text"].strip() for head in page.all("th"))
    for element in page.elements:
        if {"scroll", "plot"} & set((element.get("class") or "").split()):
            assert element["tabindex"] == "0" and element["role"] == "region" and element["aria-label"].strip()


def test_pictures_are_enlarged_in_a_dialog_and_the_style_takes_its_colours_from_the_schemes(page):
    (dialog,) = page.all("dialog")
    assert dialog["aria-label"] and any("data-close" in button for button in page.all("button"))
    enlarged = {link["href"] for link in page.all("a") if link.get("class") == "enlarge"}
    for stem in ("denim-sphere-truth", "denim-plane-woven", "scene-attic-woven", "denim-drawdown"):
        assert f"figures/{stem}.png" in enlarged
    assert "http" not in "".join(element["text"] for element in page.all("script", "style"))
    # Smooth scrolling is the only motion, and stands within its media query; contrast is tested in test_colours.py.
    style = page.all("style")[0]["text"]
    assert not re.search(r"animation|transition", style)
    outside = re.sub(r"@media \(prefers-reduced-motion: no-preference\) \{.*?\} \}", "", style)
    assert "smooth" in style and "smooth" not in outside
    for scheme, name in itertools.product((LIGHT, DARK), ("ink", "muted", "ground", "card", "tint", "focus")):
        assert f"--{name}: {getattr(scheme, name)};" in style
    assert set(re.findall(r"[^-]color: ([^;]+);", style)) <= {"var(--ink)", "var(--muted)", "inherit"}
    assert "outline: none" not in style and ":focus-visible" in style


def test_yarns_have_their_diffuse_and_their_specular_colours_and_words_are_escaped():
    assert prose("a < b in `c`") == "a &lt; b in <code>c</code>"
    denim = load_fabric("denim")
    warp, weft = fabric_card(denim, "seen")["yarns"]
    yarn = {"diffuse": denim.warp.diffuse_rgb, "specular": denim.warp.specular_rgb}
    assert warp["colours"] == [(kind, hex_colour([EXPOSURE * value for value in rgb])) for kind, rgb in yarn.items()]
    assert weft["family"] == "weft" and weft["colours"] != warp["colours"]
    several = fabric_card(load_fabric("tartan"), "seen")["yarns"][0]["colours"]
    assert [kind for kind, _ in several] == ["diffuse"] * 4 + ["specular"] * 2 and len(set(several)) == 6
