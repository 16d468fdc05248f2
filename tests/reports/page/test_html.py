"""The page for keyboard and screen reader: headings, landmarks, names of pictures and tables, links, words."""

import itertools
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from reports.images.tiles import EXPOSURE, hex_colour
from reports.options import BenchOptions
from reports.page.colours import DARK, LIGHT
from reports.page.content import ModelNote, PageInput, PictureFile
from reports.page.html import OPEN_ROWS, fabric_card, page_html, prose
from reports.record import Record, this_machine
from reports.tables.page_tables import page_frames
from reports.tables.table import WORDS
from reports.truth import accuracy, bias, effort, path_traced
from reports.truth.finding import RECORDS as FINDINGS
from reports.truth.finding import judge
from weaves.fabric import load_fabric

VOID = {"meta", "img", "source", "link", "br"}


class Reader(HTMLParser):
    """Collects (tag, attributes, depth of open tags, text) of a page in its order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements = [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.elements.append(
            {"tag": tag, **dict(attributes), "within": [one["tag"] for one in self.open], "text": "", "pictures": 0}
        )
        for one in self.open:
            one["pictures"] += tag == "img"
        if tag not in VOID:
            self.open.append(self.elements[-1])

    def handle_endtag(self, tag):
        assert self.open.pop()["tag"] == tag

    def handle_data(self, data):
        for one in self.open:
            one["text"] += data

    def all(self, *tags):
        return [one for one in self.elements if one["tag"] in tags]


def scene_records():
    records = []
    for method, setting in (("woven", ""), ("point_sampled", "k = 2")):
        subject = Record(method=method, setting=setting, scene="dinner_table")
        numbers = {"mse": 2e-3, "flip_hdr": 0.2, "flicker": 1e-3, "frame_time": 5.0, "fallback_share": 0.25}
        records += [subject.of(metric, value, 100) for metric, value in numbers.items()]
        records.append(subject.of("colour_rrmse", 0.0, 100, low=0.0, high=0.02))
    return records


def truth_records():
    """Records of every section about the truth."""
    return [
        *FINDINGS.to_records([judge("f", "corner", "float32", {"w": [0.25]}, [1.0], [1.0], 1e-6, naive=[1.001])]),
        *accuracy.RECORDS.to_records([accuracy.Accuracy("mc", "denim", 0.1, 0.1, 0.1, 64.0, 5e3, 1.0, 7e-4, 150)]),
        *bias.RECORDS.to_records([bias.Bias("denim", bias.SIDES[0], "specular_warp", 1e-3, 5e-4, 900)]),
        *path_traced.RECORDS.to_records([path_traced.Traced("soft_nodes:2", "drape", "4", 2.5e-3, 1.5, 4, 3.25)]),
        *effort.RECORDS.to_records([effort.Effort("table alone", "denim", 1.0, 4000.0, 2e-5, 900)]),
    ]


@pytest.fixture(scope="module")
def text(made_up):
    """A page with nearly all sections, without its files."""
    return page_of(made_up)


def page_of(measured):
    """Return the page of a benchmark, with more Records."""
    denim = Record(method="woven", fabric="denim", role="seen")
    more = [denim.of("silhouette_coverage", 0.1, 9), denim.of("silhouette_displacement", 0.1, 9)]
    more += [denim.of("silhouette_light", 0.1, 9), denim.of("encode_time", 0.2, 9, low=0.1, high=0.3)]
    more.append(Record(method="woven").of("extreme_error", 0.5, 90, curve=((1e-4, 0.5), (1.0, 0.125))))
    pictures = [
        PictureFile(fabric, scene, method, "", Path("x.exr"))
        for fabric, scene in (("denim", "sphere"), ("denim", "plane"), ("", "dinner_table"))
        for method in ("truth", "woven")
    ]
    records = [*measured, *more, *scene_records(), *truth_records()]
    models = [ModelNote("woven", "one network"), ModelNote("point_sampled", "nothing is trained")]
    fabrics = [(load_fabric(name), "seen") for name in ("denim", "basket")]
    page = PageInput("tiny", "", "0123", "tiny-0", fabrics, models, BenchOptions(), records, this_machine(1), pictures)
    page = replace(page, live={"denim": Path("denim.html")})
    return page_html(page, page_frames(records), set(WORDS["plots"]))


def test_several_trainings_have_a_mean_and_a_range(text, three_trainings):
    """MSE of 1, 2 and 3 parts of that of k = 9 on denim and basket, whose mean is 1.5e-3 / 9; 2 points have 7.5e-4."""
    found = page_of(three_trainings)
    said = " ".join(re.sub("<[^>]+>", " ", found).split())
    assert "Woven reaches 2.2× lower MSE (1.5× to 4.5× over 3 trainings) than point sampling at 2 points" in said
    assert "NeuMIP reaches 4.5× lower MSE" in said and "(one training)" in said
    assert "3.33e−4 (3.09 … 3.58)e−4 [1.67 … 5.00]e−4" in said and "2.2× (2 … 2.5×) [1.5 … 4.5×]" in said
    assert "Networks were trained up to 3 times" in said and "Of 3 trainings, pictures show the first." in said
    assert "Numbers of woven are means over 3 trainings" in said and "One training of NeuMIP" in said
    once = " ".join(re.sub("<[^>]+>", " ", text).split())
    assert "trainings" not in once.partition("Definitions of the columns")[0]


def test_each_unseen_fabric_is_shown_and_the_interval_over_them(text, two_unseen):
    """Woven has 4.5 and 1.125 times lower MSE: geometric mean 2.25, in an interval of t = 12.7 and one degree."""
    said = " ".join(re.sub("<[^>]+>", " ", page_of(two_unseen)).split())
    assert "2.2× lower MSE on the 2 unseen fabrics (geometric mean, 95 % interval over fabrics 0.00034× to 15," in said
    assert "Means over unseen fabrics, with their 95 % intervals over fabrics" in said
    table = said.partition("MSE of every unseen fabric")[2]
    assert "twill 4/4 unseen 0 irregular" in table.partition("woven")[0]
    assert table.partition("NeuMIP")[2].split()[1] == "–"
    alone = " ".join(re.sub("<[^>]+>", " ", text).split())
    assert "Means over unseen fabrics" not in alone and "on one unseen fabric" in alone


@pytest.fixture(scope="module")
def page(text):
    return Reader(text)


def test_nearly_all_sections_are_there(page):
    """Else the tests below look at little."""
    ids = {one.get("id") for one in page.all("section")}
    assert set(WORDS["sections"]) - ids <= {"equal-time", "energy", "rates", "sampler", "other"}


def test_path_traced_frames_have_a_table(page):
    (table,) = [one for one in page.all("table") if "path-traced" in one["text"]]
    assert "drape\nsoft nodes:242.50e−31.50 s3.2×" in table["text"]


def test_headings_have_no_gaps(page):
    levels = [int(one["tag"][1]) for one in page.all("h1", "h2", "h3", "h4", "h5", "h6")]
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(after <= before + 1 for before, after in itertools.pairwise(levels))
    assert all(one["text"].strip() for one in page.all("h1", "h2", "h3"))


def test_landmarks_are_there_once(page):
    for tag in ("header", "nav", "main", "footer"):
        (one,) = page.all(tag)
        assert "main" not in one["within"] or tag == "main"
    assert page.all("nav")[0]["aria-label"]
    assert all("main" in one["within"] for one in page.all("section"))
    assert page.all("html")[0]["lang"] == "en" and page.all("title")[0]["text"]


def test_the_first_link_skips_to_the_content(page):
    first = page.all("a")[0]
    (main,) = page.all("main")
    assert first["href"] == f"#{main['id']}" and first["class"] == "skip" and main["tabindex"] == "-1"


def test_ids_are_unique_and_links_within_the_page_arrive(page):
    ids = [one["id"] for one in page.elements if "id" in one]
    assert len(set(ids)) == len(ids)
    targets = {one["href"][1:] for one in page.all("a") if one["href"].startswith("#")}
    assert targets <= set(ids) and set(WORDS["sections"]) & set(ids) <= targets


def test_every_picture_says_in_words_what_is_seen(page):
    pictures = page.all("img")
    assert len(pictures) > 20
    assert all(one["alt"].strip() for one in pictures)
    shown = [(one["src"], one["alt"]) for one in pictures]
    by_file = {}
    for source, alt in set(shown):
        by_file.setdefault(alt, set()).add(source)
    assert all(len(sources) == 1 for sources in by_file.values()), "two pictures have the same words"


def test_links_have_names(page):
    """A link round a picture has the words of the picture."""
    for one in page.all("a", "button", "summary"):
        assert one["text"].strip() or one["pictures"]


def test_every_table_has_a_caption_and_its_headers_a_scope(page):
    tables = page.all("table")
    assert len(tables) == len(page.all("caption")) > 8
    assert all(one["text"].strip() for one in page.all("caption"))
    assert all(one["scope"] in ("col", "row", "rowgroup") and one["text"].strip() for one in page.all("th"))


def test_what_scrolls_can_be_reached_and_has_a_name(page):
    for one in page.elements:
        if {"scroll", "plot"} & set((one.get("class") or "").split()):
            assert one["tabindex"] == "0" and one["role"] == "region" and one["aria-label"].strip()


def test_pictures_are_enlarged_in_a_dialog_without_other_files(page, text):
    (dialog,) = page.all("dialog")
    assert dialog["aria-label"] and "src" not in page.all("script")[0]
    assert any("data-close" in one for one in page.all("button"))
    enlarged = {one["href"] for one in page.all("a") if one.get("class") == "enlarge"}
    for stem in ("denim-sphere-truth", "denim-plane-woven", "scene-dinner_table-woven", "denim-drawdown"):
        assert f"figures/{stem}.png" in enlarged
    assert "http" not in "".join(one["text"] for one in page.all("script", "style"))


def test_motion_is_left_out_where_it_is_not_wanted(page):
    """Smooth scrolling is the only motion, and stands within its media query."""
    style = page.all("style")[0]["text"]
    assert not re.search(r"animation|transition", style)
    outside = re.sub(r"@media \(prefers-reduced-motion: no-preference\) \{.*?\} \}", "", style)
    assert "smooth" in style and "smooth" not in outside


def test_the_style_takes_its_colours_from_the_schemes(page):
    """Their contrast is tested in test_contrast.py; no other colour of text is written in the style sheet."""
    style = page.all("style")[0]["text"]
    for scheme in (LIGHT, DARK):
        for name in ("ink", "muted", "ground", "card", "tint", "focus"):
            assert f"--{name}: {getattr(scheme, name)};" in style
    assert set(re.findall(r"[^-]color: ([^;]+);", style)) <= {"var(--ink)", "var(--muted)", "inherit"}
    assert "outline: none" not in style and ":focus-visible" in style


def test_words_of_earlier_versions_are_gone(page):
    words = page.all("body")[0]["text"] + " ".join(one["alt"] for one in page.all("img"))
    for word in ("stand in", "stands in", "asked", "errs", "left to quadrature", "not its own", "knob", "leftover"):
        assert not re.search(rf"\b{word}\b", words), word
    assert not [one["text"] for one in page.all("h1", "h2", "h3", "caption") if one["text"].startswith("What")]


def test_words_are_escaped_and_code_is_marked():
    assert prose("a < b in `c`") == "a &lt; b in <code>c</code>"


def test_long_tables_open_on_demand(made_up):
    """A table of more rows than `OPEN_ROWS` is closed, a shorter one is not."""
    many = [
        one.model_copy(update={"setting": f"k = {100 + index}"})
        for one in made_up
        if (one.method, one.setting) == ("point_sampled", "k = 64")
        for index in range(OPEN_ROWS)
    ]
    page = Reader(page_of([*made_up, *many]))
    inside = [one["text"].strip() for one in page.all("caption") if "details" in one["within"]]
    assert any(text.startswith("Errors, seen fabrics") for text in inside)
    assert not any(text.startswith("Errors at silhouettes") for text in inside)


def shown(rgb):
    return hex_colour([EXPOSURE * value for value in rgb])


def test_a_yarn_has_its_diffuse_and_its_specular_colour():
    denim = load_fabric("denim")
    warp, weft = fabric_card(denim, "seen")["yarns"]
    assert warp["colours"] == [("diffuse", shown(denim.warp.diffuse_rgb)), ("specular", shown(denim.warp.specular_rgb))]
    assert weft["family"] == "weft" and weft["colours"] != warp["colours"]


def test_threads_of_several_colours_have_them_all():
    colours = fabric_card(load_fabric("tartan"), "seen")["yarns"][0]["colours"]
    assert [kind for kind, _ in colours] == ["diffuse"] * 4 + ["specular"] * 2
    assert len(set(colours)) == 6
