"""Bad inputs: each ends with exit code 1 or 2 and one short sentence, in little time and memory."""

import contextlib
import os
import resource
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jobs.cli import main
from jobs.recipe.load import load_recipe
from pipeline.folders import own_files
from pipeline.models.added.describe import describe
from pipeline.scenes.catalogue import load_scene
from pipeline.shards.query_file import check_columns, open_queries, refuse_bad
from reports.record import Record, read_records, this_machine, write_records
from tests.presets import slow
from tests.refusals import accepted, ends, refusal
from tests.weaves.draft_files.drafts import wif
from weaves.draft_files.read import read_draft
from weaves.draft_files.write import wif_text
from weaves.errors import MOST_LETTERS
from weaves.fabric import load_fabric

MEMORY = 1 << 30

FORMATS = {
    "fabric": ("bad.toml", "show bad.toml"),
    "recipe": ("bad.toml", "plan bad.toml"),
    "scene": ("bad.xml", "plan names_xml.toml"),
    "described scene": ("bad.toml", "plan names_toml.toml"),
    "queries": ("bad.parquet", "evaluate denim bad.parquet --out a.parquet"),
    "records": ("bad.json", "compare bad.json good.json"),
    "page": ("bad.md", "results smoke --readme bad.md"),
    "scheduler": ("bad.json", "generate smoke --scheduler bad.json"),
    "draft": ("bad.wif", "import bad.wif --out a.toml"),
}
"""A file of every format that comes from outside, and a command that reads it: every kind of broken file meets it."""

VERBS = [
    ("bad.toml", "export bad.toml --mesh a.ply"),
    ("bad.toml", "evaluate bad.toml good.parquet --out a.parquet"),
    *(("bad.toml", f"{verb} bad.toml") for verb in ("generate", "train", "bench", "report")),
    *(("bad.toml", f"{verb} bad.toml") for verb in ("run", "status", "results", "check")),
    ("bad.xml", "savings smoke bad.xml"),
    ("bad.toml", "savings smoke bad.toml"),
    ("bad.json", "compare good.json bad.json"),
    ("manifest.json", "check ."),
    ("card.json", "evaluate denim good.parquet --out a.parquet --model ."),
]
"""The other commands that read a file: three kinds of broken file meet each."""

FEW = ("missing", "pipe", "random")


def _link(target):
    return lambda path: path.symlink_to(target)


def _text(text):
    return lambda path: path.write_bytes(text.encode() if isinstance(text, str) else text)


def _huge(path):
    with path.open("wb") as file:
        file.truncate(10**8 if path.suffix == ".toml" else 10**11)


KINDS = {
    "missing": lambda path: None,
    "folder": lambda path: path.mkdir(),
    "pipe": os.mkfifo,
    "device": _link("/dev/zero"),
    "circle": lambda path: path.symlink_to(path),
    "dangling": _link("nowhere"),
    "empty": _text(""),
    "huge": _huge,
    "zeros": _text(b"\0" * 1000),
    "random": _text(np.random.default_rng(0).bytes(1000)),
    "latin-1": _text('name = "caf\xe9"'.encode("latin-1")),
    "brackets": _text("[" * 20_000),
    "dotted": _text("a." * 100_000 + "b = 1"),
    "quoted dots": _text('"a\\""."b".' * 10_000 + "c = 1"),
    "tables": _text("a = " + "{a = " * 20_000),
    "large integer": _text("a = 0x" + "f" * 200_000),
    "digits": _text("a = " + "1" * 200_000),
    "escapes": _text('name = "\\u001b[31m"\n[draft]\nfamily = "\\u009b2J"\n[dataset]\nseen = ["\\u001b]0;x\\u0007"]\n'),
    "unknown keys": _text("\n".join(f"key_{index} = {index}" for index in range(15_000))),
    "json": _text('{"name": ' + '{"a": ' * 2000 + "1" + "}" * 2001),
}

RECIPE = {
    "name": '"x"', "dataset.seen": '["denim"]', "dataset.shard_rows": "256", "dataset.seed": "0",
    "dataset.unseen": "[]", "dataset.rows.train": "256", "dataset.rows.test": "256", "dataset.population.count": "0",
    "dataset.unseen_population.count": "0", "dataset.queries.sigma": "[0.1, 1.0]", "dataset.truth.max_count": "4096",
    "dataset.truth.relative_error": "0.1", "dataset.truth.estimator": '"auto"', "bench.frames": "3",
    "bench.timing_rows": "64", "bench.threads": "[1]", "bench.scenes.names": "[]",
}  # fmt: skip
FABRIC = {
    "name": '"x"', "source": '""', "optical_thickness": "2.0", "draft.family": '"twill"', "draft.over": "[2]",
    "draft.under": "[2]", "warp.bend": "20.0", "warp.roughness": "0.3", "warp.diffuse": '"#804020"',
    "weft.bend": "20.0", "weft.roughness": "0.3",
}  # fmt: skip
SATIN = {"draft.family": '"satin"', "draft.ends": "6", "draft.move": "3"}
SCENE = {"name": '"x"', "source": '"good.xml"', "frames": "3", "step": "[0.0, 0.0, 0.0]"}

VALUES = [
    *("9223372036854775808", "-1", "0x" + "f" * 5000, "1e999", "nan", "1979-05-27", '"\\u001b[2J\\u0007"'),
    *('"' + "long " * 2000 + '"', "[" + "1, " * 5000 + "]", "{ a = { b = 1 } }"),
]
"""Values that none of the keys allows."""

SINGLE = [
    ("recipe", "dataset.rows.train", "10000000000"),
    ("recipe", "dataset.rows.test", "64000001"),
    ("recipe", "dataset.population.count", "100001"),
    ("recipe", "dataset.unseen_population.count", "1001"),
    ("recipe", "dataset.unseen_population.balanced", "1"),
    ("recipe", "dataset.truth.max_count", str(2**62)),
    *(("recipe", "dataset.seen", f'["{name}"]') for name in ("../../etc/passwd", "x\\u0000.toml", "a" * 300 + ".toml")),
    ("recipe", "bench.timing_repeats", "19"),
    ("recipe", "bench.sphere_size", "[0, 8]"),
    ("recipe", "bench.views", "[]"),
    ("recipe", "bench.frames", "2"),
    ("recipe", "name", f'"{"x" * 61}"'),
    *(("recipe", "bench.scenes.names", f'["{name}"]') for name in ("pipe.xml", "a" * 300 + ".xml")),
    *(("described scene", "source", f'"{name}"') for name in ("pipe.xml", "a" * 5000, "a\\u0000.xml")),
    ("fabric", "draft.over", "[" + "100, " * 300 + "]"),
    ("fabric", "draft.over", "[254]"),
]
"""Subjects, keys and values that are refused for a reason of their own."""

LINES = Path(__file__).with_name("bad_commands.txt").read_text(encoding="utf-8").splitlines()
"""Commands as bodies of f-strings, then words of the sentence that refuses each."""

COMMANDS = [(eval(f"f'''{line}'''"), words) for line, _, words in (line.partition(" => ") for line in LINES)]


def write(path, base, change):
    """Write a TOML file of dotted keys with some of them changed."""
    lines = [f"{key} = {value}" for key, value in (base | change).items()]
    path.write_text("\n".join(lines), encoding="utf-8")


ALLOWED = {("source", 6), ("source", 7)}
"""Keys and values that are no bad input after all: what a fabric's `source` says is free, up to its length."""


def surroundings():
    """Write the good files that commands name, and bad ones that stay."""
    texts = {"good.json": '[{"method": "a"}]', "good.xml": "<scene/>", "good.wif": wif_text(load_fabric("denim"))}
    texts |= {"file": "no table and no folder", "broken.toml": "name = \n", "neither.toml": 'name = "x"\n'}
    texts |= {"threadless.wif": wif(THREADING=None)}
    texts |= {"bare.xml": '<scene version="3.0.0"><shape type="sphere"/></scene>'}
    texts |= {"own.py": "def own(fabric, queries):\n    return queries.u", "maps.json": '{"files": {"good.wif": "0"}}'}
    for name, text in texts.items():
        Path(name).write_text(text, encoding="utf-8")
    for folder in ("folder.ply", "folder.png", "twill_4_4"):
        Path(folder).mkdir()
    os.mkfifo("pipe.xml")
    for suffix in (".xml", ".toml"):
        write(Path(f"names_{suffix[1:]}.toml"), RECIPE, {"bench.scenes.names": f'["bad{suffix}"]'})
    page = Path("out/report/smoke")
    page.mkdir(parents=True)
    for path in (page / "records.json", Path("records.json")):
        write_records(path, [Record(method="a")], this_machine(1))
    query = {"u": 0.5, "v": 0.5, "sigma": 0.5, "wi_x": 0.6, "wi_y": 0.0, "wi_z": 0.8}
    query |= {"wo_x": 0.0, "wo_y": 0.0, "wo_z": 1.0}
    rows = {name: np.full(10, value) for name, value in query.items()}
    pq.write_table(pa.table(rows), "good.parquet")
    rows["wi_z"][[4, 9]] = 3.0
    pq.write_table(pa.table(rows), "long.parquet")
    Path("cut.parquet").write_bytes(Path("good.parquet").read_bytes()[:-100])
    Path("twill_4_4/x").touch()
    write(Path("nan.toml"), FABRIC, {"warp.bend": "nan"})
    write(Path("bright.toml"), FABRIC, {"warp.diffuse": '"#ffffff"'})
    write(Path("satin.toml"), {key: text for key, text in FABRIC.items() if "draft" not in key}, SATIN)


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good")
    with contextlib.chdir(folder):
        surroundings()
    return folder


@pytest.fixture
def place(good, monkeypatch):
    """Enter the folder of good files; a bad one is removed at the end."""
    monkeypatch.chdir(good)
    yield
    clear()


def clear():
    """Remove bad files and what a command may have written."""
    for path in (path for name in ("bad.*", "a.*", "manifest.json", "card.json") for path in Path().glob(name)):
        shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def place_bad(kind, file):
    """Put a broken file in the place of the one before."""
    clear()
    KINDS[kind](Path(file))


def faults(code, sentence, shown, words=()):
    """Return what is wrong with the end of a command, whose sentence should have some words."""
    lines = sentence.splitlines()
    found = [] if code in (1, 2) else [f"exit code {code}"]
    found += [] if len(lines) == 1 else [f"{len(lines)} lines on stderr"]
    found += [f"{len(line)} letters" for line in lines if len(line) > MOST_LETTERS]
    found += ["control characters"] if not (sentence + shown).replace("\n", "").isprintable() else []
    found += [word for word in ("Traceback", "this is a bug") if word in sentence]
    return found + [f"lacks {part!r}" for part in words if part not in sentence]


def wrong_end(command, capsys, words=""):
    """Run a command that must be refused; return what is wrong with its end, its sentence, and files that it left."""
    before = set(Path().iterdir())
    with ends():  # a pipe that is opened would wait for ever
        code = main(shlex.split(command))
    captured = capsys.readouterr()
    wrong = faults(code, captured.err, captured.out, words.split(" & "))
    wrong += [f"wrote {name}" for name in set(Path().iterdir()) - before]
    return [(command[:100], wrong, code, captured.err[:1000])] if wrong else []


@pytest.mark.parametrize(
    ("file", "command", "kinds"),
    [*((*read, KINDS) for read in FORMATS.values()), *((*read, FEW) for read in VERBS)],
    ids=[*FORMATS, *(command for _, command in VERBS)],
)
def test_a_broken_file_is_refused_in_every_format_and_by_every_verb(file, command, kinds, place, capsys):
    wrong = []
    for kind in kinds:
        place_bad(kind, file)
        wrong += [(kind, *end) for end in wrong_end(command, capsys)]
    assert not wrong


BASES = {"recipe": (RECIPE, load_recipe), "fabric": (FABRIC, load_fabric), "described scene": (SCENE, load_scene)}


@pytest.mark.parametrize(("subject", "key"), [(subject, key) for subject, (base, _) in BASES.items() for key in base])
def test_a_bad_value_at_any_key_is_refused(subject, key, place):
    base, read = BASES[subject]
    for value in (value for index, value in enumerate(VALUES) if (key, index) not in ALLOWED):
        write(Path("bad.toml"), base, {key: value})
        refusal(read, "bad.toml")


@pytest.mark.parametrize("subject", BASES)
def test_single_bad_values_are_refused(subject, place, capsys):
    wrong = []
    for key, value in (bad for of, *bad in SINGLE if of == subject):
        write(Path("bad.toml"), BASES[subject][0], {key: value})
        wrong += [(key, value[:100], *end) for end in wrong_end(FORMATS[subject][1], capsys)]
    assert not wrong


@pytest.mark.parametrize("verb", sorted({command.partition(" ")[0] for command, _ in COMMANDS}))
def test_a_command_that_cannot_be_used_is_refused(verb, place, capsys, monkeypatch):
    monkeypatch.setattr("jobs.run.cluster._SECONDS", 0.2)  # for a scheduler that is not there
    wrong = []
    for command, words in COMMANDS:
        if command.partition(" ")[0] == verb:
            clear()
            wrong += wrong_end(command, capsys, words)
    assert not wrong


LARGE_KINDS = ("huge", "device", "quoted dots", "dotted", "brackets", "unknown keys")


@pytest.mark.slow
def test_the_largest_ones_take_less_than_a_gigabyte():
    # In a process of its own, so that nothing else counts.
    program = "import sys; from tests.jobs.test_bad_inputs import alone; sys.exit(alone())"
    subprocess.run([sys.executable, "-c", program], cwd=Path(__file__).parents[2], check=True)


def alone():
    """Run the largest bad inputs in this process; return 0 if it never took as much memory as is allowed."""
    resource.setrlimit(resource.RLIMIT_DATA, (4 * MEMORY, 4 * MEMORY))
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        surroundings()
        for file, command in FORMATS.values():
            for kind in LARGE_KINDS:
                place_bad(kind, file)
                main(command.split(" "))
        os.chdir("/")
    # `ru_maxrss` would also be what the process that started this one has ever taken.
    peak = Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]
    return int(int(peak) * 1024 > MEMORY)


values = st.recursive(
    st.one_of(st.booleans(), st.integers(-(2**63), 2**63 - 1), st.floats(), st.text(max_size=20)),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(st.text(max_size=8), inner, max_size=3)),
    max_leaves=5,
)


WHOLE = {"recipe": ["models", "bench", "dataset", "dataset.truth.nothing"]}
WHOLE |= {"described scene": ["cloths", "cloths.denim"]}
"""More keys of these files."""


@pytest.mark.parametrize("subject", WHOLE)
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data(), values)
def test_a_file_with_any_value_at_any_key_is_read_or_one_sentence(place, subject, data, value):
    base, read = BASES[subject]
    inner = table = tomllib.loads("\n".join(f"{name} = {text}" for name, text in base.items()))
    *parents, last = data.draw(st.sampled_from([*base, *WHOLE[subject]])).split(".")
    for parent in parents:
        inner = inner.setdefault(parent, {})
    inner[last] = value
    Path("any.toml").write_text(tomli_w.dumps(table), encoding="utf-8", errors="surrogatepass")
    accepted(read, "any.toml")


def read_queries(path):
    with open_queries(path) as file:
        check_columns(path, file.schema_arrow, ())
        refuse_bad(path, file, (2, 2))


def export_again(path):
    with own_files(path.parent, path.name):
        pass


READERS = {
    "recipe": ("names_toml.toml", load_recipe), "fabric": ("satin.toml", load_fabric),
    "scene": ("bare.xml", load_scene),
    "draft": ("good.wif", read_draft), "queries": ("good.parquet", read_queries), "export": ("maps.json", export_again),
    "records": ("records.json", lambda path: read_records([path])),
    "method": ("own.py", lambda path: describe(f"{path}:own", {}, {})),
}  # fmt: skip
"""A good file of every kind that comes from outside, and what reads it."""


@pytest.mark.parametrize("subject", [slow(subject) if subject == "method" else subject for subject in READERS])
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 8), st.binary(max_size=8)), min_size=1, max_size=4))
def test_a_file_with_any_other_bytes_is_read_or_one_sentence(place, subject, changes):
    file, read = READERS[subject]
    content = bytearray(Path(file).read_bytes())
    for start, length, new in changes:
        start %= len(content) + 1
        content[start : start + length] = new
    path = Path(f"bad.{file}").absolute()
    path.write_bytes(content)
    with ends(60):
        accepted(read, path)
