"""A page with every section, written once, and what a parser reads of it."""

from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from reports import catalogue
from reports.catalogue import MetricRow
from reports.images.exr import frame_layers, write_exr
from reports.measure.by_size import EDGES
from reports.measure.latents import SHARES
from reports.measure.pictures import write_picture
from reports.measure.scene.image_error import image_errors
from reports.options import BenchOptions, SceneBenchOptions
from reports.page.content import ModelNote, PageInput, PictureFile
from reports.page.page import write_page
from reports.record import Record, this_machine
from reports.truth import accuracy, bias, effort, finding, measured_cloth, path_traced, sampling
from weaves.fabric import load_fabric

VOID = {"meta", "img", "source", "link", "br"}


class Reader(HTMLParser):
    """Collects the elements of a page with their attributes and text, and checks that its tags nest."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.shown = [], [], []
        self.feed(text)
        assert self.open == []
        self.words = " ".join("".join(self.shown).split()).replace("\u00a0", " ")
        self.ids = [element["id"] for element in self.elements if "id" in element]
        links = [element[name] for element in self.elements for name in ("src", "srcset", "href") if name in element]
        self.targets = [link[1:] for link in links if link.startswith("#")]
        self.files = [link for link in links if not link.startswith("#")]

    def handle_starttag(self, tag, attributes):
        within = [element["tag"] for element in self.open]
        self.elements.append({"tag": tag, **dict(attributes), "within": within, "text": "", "pictures": 0})
        for element in self.open:
            element["pictures"] += tag == "img"
        if tag not in VOID:
            self.open.append(self.elements[-1])

    def handle_endtag(self, tag):
        assert self.open.pop()["tag"] == tag

    def handle_data(self, data):
        for element in self.open:
            element["text"] += data
        if not self.open or self.open[-1]["tag"] not in ("style", "title", "script"):
            self.shown.append(data)

    def all(self, *tags):
        return [element for element in self.elements if element["tag"] in tags]


def of_methods():
    """Return Records of a method's silhouettes, edits, extremes, furnace, footprints and of a metric from outside."""
    denim = Record(method="woven", fabric="denim", role="seen")
    numbers = {"silhouette_coverage": 0.125, "silhouette_displacement": -0.03, "silhouette_light": 0.25}
    records = [denim.of(name, value, 100) for name, value in numbers.items()]
    records += [denim.of(f"furnace_{name}", 0.5, 9) for name in ("diffuse", "specular", "colour")]
    path = denim.model_copy(update={"note": "yarns of satin_8"})
    curve = tuple(zip(SHARES, (0.01, 0.15, 0.2, 0.1, 0.02), strict=True))
    records += [path.of("path_error", 0.2, 64, curve=curve), path.of("reencode_error", 0.2, 64, curve=curve[::-1])]
    encoded = denim.model_copy(update={"note": "random samples"})
    records.append(encoded.of("encoding_error", 0.17, 9, curve=((5.0, 0.303), (500.0, 0.17))))
    records.append(denim.model_copy(update={"note": "a colour"}).of("encode_time", 0.25, 25, low=0.24, high=0.31))
    half = Record(method="woven", setting="eager-bf16")
    records.append(half.of("extreme_error", 0.5, 90, curve=((1e-4, 0.5), (1.0, 0.125))))
    records += [half.of(f"extreme_{name}", value, 180) for name, value in (("rounding", 0.004), ("not_finite", 3.0))]
    for method, setting in (("woven", ""), ("point_sampled", "k = 1"), ("point_sampled", "k = 2")):
        sizes = tuple((edge, 0.5) for edge in EDGES[:-1])
        subject = Record(method=method, setting=setting)
        names = ("size_time", "size_colour", "size_specular", "size_diffuse")
        records += [subject.of(name, 0.5, 9, curve=sizes) for name in names]
    records.append(Record(method="woven", setting="compile", metric="not_run", value=1.0, note="no <compiler>"))
    records.append(Record(method="woven", note="a <fast> laptop").of("stated_time", 1500.0, 1))
    others = {"stated_bytes": 5000.0, "stated_multiply_adds": 300.0, "stated_tries": 2.0, "added_largest_error": 0.25}
    return records + [Record(method="woven").of(name, value, 1) for name, value in others.items()]


def of_truth():
    """Return Records of every section about the truth."""
    findings = [
        finding.judge("σ", "near <the> axis", "float32", {"w": [0.25]}, [1.0], [1.0], 1e-6, naive=[1.001]),
        finding.judge("f_t", "equal Λ", "float64", {"w": [0.5]}, [1.5], [1.0], 1e-15, naive=[np.nan]),
    ]
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
    efforts = [("table alone", 0.75, 4000.0, 2e-5), ("sampled", 0.25, 9000.0, 2e-3)]
    return [
        *finding.RECORDS.to_records(findings),
        *accuracy.RECORDS.to_records(accuracies),
        *bias.RECORDS.to_records(biases),
        *effort.RECORDS.to_records(effort.Effort(kind, "denim", *numbers, 900) for kind, *numbers in efforts),
        *path_traced.RECORDS.to_records([path_traced.Traced("soft_nodes:2", "drape", "4", 2.5e-3, 1.5, 4, 3.25)]),
        *measured_cloth.RECORDS.to_records([measured_cloth.Prediction("cosine", "shade", "reflectance", error=0.25)]),
        *sampling.RECORDS.to_records([sampling.VarianceSaving("lobes", "denim", 20.5, 12.25, 210.0, 900.0, 40)]),
        Record(method="truth", setting="everything", note="fast").of("rate", 4.5e8, 1),
    ]


def scene(folder):
    """Return Records and pictures of a scene: three frames by the truth, by a method and by the baseline."""
    random = np.random.default_rng(2)
    truth = 0.1 + random.random((3, 24, 32, 3))
    lit = np.ones((24, 32), bool)
    lit[:6] = False
    pictures, records = [], []
    for method, setting, factor in (("truth", "", 1.0), ("woven", "", 1.08), ("point_sampled", "k = 2", 0.6)):
        path, layers = folder / f"{method}.exr", frame_layers(factor * truth)
        if method != "truth":
            subject = Record(method=method, setting=setting, scene="attic")
            errors, maps = image_errors(subject, factor * truth[0], truth[0], 0.01 * truth[0], lit)
            layers |= maps
            records += [*errors, subject.of("frame_time", 20.0 * factor, 25)]
            records += [subject.of("colour_rrmse", abs(factor - 1), 900), subject.of("flicker", factor - 1, 3)]
        write_picture(path, factor * truth[0], np.ones_like(lit), {}, layers=layers)
        pictures.append(PictureFile("", "attic", method, setting, path))
    return records, pictures


@pytest.fixture(scope="session")
def page_input(made_up, tmp_path_factory):
    """The content of a page with every section."""
    folder = tmp_path_factory.mktemp("pictures")
    random = np.random.default_rng(0)
    records, pictures = scene(folder)
    for fabric in ("denim", "basket", "twill_4_4"):
        for view in ("sphere", "plane"):
            for method, setting in (("truth", ""), ("woven", ""), ("point_sampled", "k = 2")):
                path = folder / f"{fabric}-{view}-{method}.exr"
                write_exr(path, {name: random.random((12, 16)) for name in "RGB"} | {"A": np.ones((12, 16))})
                pictures.append(PictureFile(fabric, view, method, setting, path))
    live = folder / "live-denim-01234567.html"
    live.write_bytes(b"<title>denim</title>")
    danger = load_fabric("denim").model_copy(update={"source": "<script>alert('cloth')</script> & more"})
    words = "added_largest_error", "largest error", "Largest error of all queries."
    row = MetricRow(*words, unit="1/sr", format="percent")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(catalogue.METRICS, row.name, row)
        yield PageInput(
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
            options=BenchOptions(scenes=SceneBenchOptions(names=("attic",), frames=3)),
            records=[*made_up, *of_methods(), *of_truth(), *records],
            machine=this_machine(1),
            pictures=pictures,
            live={"denim": live},
        )


@pytest.fixture(scope="session")
def folder(page_input, tmp_path_factory):
    """The page as it is written."""
    shares = []
    folder = tmp_path_factory.mktemp("report")
    assert write_page(folder, page_input, shares.append) == folder / "index.html"
    assert shares == sorted(shares) and shares[-1] <= 1
    return folder


@pytest.fixture(scope="session")
def page(folder):
    return Reader((folder / "index.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="session")
def bare(page_input, made_up):
    """Content without Records, pictures and live pages; its NeuMIP is a rule, and its lines are many."""
    models = [page_input.models[0], ModelNote("neumip", "a rule", kind="soft_nodes"), page_input.models[2]]
    return replace(page_input, models=models, records=[], pictures=[], live={})
