"""Exported folders, and the shader compiled as C++ and called from Python, or run by a browser."""

import base64
import ctypes
import io
import json
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import safetensors.torch
import torch
from PIL import Image

from pipeline.fingerprint import IDENTITY, fingerprint
from pipeline.models.card import write_model
from pipeline.models.neumip import NeumipOptions
from pipeline.models.neumip.model import NeumipNetwork
from pipeline.models.woven import WovenOptions
from pipeline.models.woven.model import WovenNetwork
from pipeline.shader.export_shader import write_shader
from pipeline.shader.languages import Program, compile_program, slangc
from tests.browser import opened
from weaves.fabric import load_fabric

FORMAT_PAGE = Path(__file__).parents[3] / "docs" / "shader_format.md"

_ROWS = re.findall(r"^\| ([^|]+) \| ([\d.e-]+) \|$", FORMAT_PAGE.read_text(encoding="utf-8"), re.M)

ALLOWED = {form: float(share) for forms, share in _ROWS for form in forms.split(", ")}
"""Largest difference from golden answers, as a share of the range of a column, as the page promises it to readers."""

FORMS = [("float32", ALLOWED["C++"]), ("float16", ALLOWED["16 bits"])]
"""Types of numbers, and what is allowed of the C++ form with them."""


CLOTH = "gingham"
"""The fabric of the trained `neumip`, and of the programs, which take every fabric."""

ALIKE = "gauze"
"""The fabric of the program of all whose threads do not differ in colour."""


def bytes_of(folder):
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """A function that exports a fabric once, and returns its folder; models take no level."""
    home = tmp_path_factory.mktemp("shaders")

    @cache
    def export(name, level=2, *languages, kinds=(), model=None):
        if {*languages} - {"onnx"} and slangc() is None:
            pytest.skip("slangc is not installed")
        folder = home / "-".join((name, str(level), *languages, "of", *kinds, Path(model or "soft_nodes").name))
        write_shader(load_fabric(name), folder, model, None if model else level, languages, kinds)
        return folder

    return export


def read(folder, type_of_numbers="float32"):
    """Read an exported folder as a program would that has only its files."""
    (listing,) = (path for path in folder.glob("*.json") if path.name != "golden.json")
    about = json.loads(listing.read_text())
    codes = {"int32": "<i4", "float32": "<f4", "float16": "<f2"}
    buffers = {}
    for name, buffer in about["buffers"].items():
        kind = type_of_numbers if type_of_numbers in buffer["files"] else next(iter(buffer["files"]))
        path = folder / buffer["files"][kind]
        if kind == "uint8":
            values = np.asarray(Image.open(io.BytesIO(path.read_bytes()))).ravel()
        else:
            values = np.frombuffer(path.read_bytes(), codes[kind])
        count = buffer["elements"] * buffer["channels"]
        assert len(values) >= count and (kind == "uint8" or len(values) == count)
        buffers[name] = values if kind in ("int32", "uint8") else values.astype(np.float32)
    golden = json.loads((folder / about["golden"]).read_text())
    queries = np.array(golden["queries"], np.float32)
    columns = (golden[name] for name in ("components", "bounds", "transparency", "density", "colour"))
    answers = np.column_stack([np.array(column) for column in columns if column])
    return SimpleNamespace(about=about, buffers=buffers, queries=queries, answers=answers, groups=golden["groups"])


def apart(answers, cloth, first=0):
    """Return the largest difference from the golden answers from a column on, as a share of its range in its group.

    One row may differ: the last digit of its normal, more so in half precision, turns a node towards the light.
    """
    differences = []
    for start, stop in cloth.groups.values():
        expected = cloth.answers[start:stop, first : first + answers.shape[1]]
        # What is 0 throughout, as the transparency of a dense cloth, has no range.
        span = np.maximum(np.ptp(expected, axis=0), 1e-12)
        differences.extend((np.abs(answers[start:stop] - expected) / span).max(axis=1))
    return sorted(differences)[-2]


def check_answers(answers, cloth, allowed):
    """Compare components and bounds (N, 8) with the golden ones: all are positive, components at most their bounds."""
    assert apart(answers, cloth) < allowed, cloth.about["fabric"]
    assert (answers >= 0.0).all() and (answers[:, :4] <= answers[:, 4:]).all()


WIDTHS = {"evaluate": (12, 8), "scatter": (16, 16)}
"""Columns of the rows of each entry point, and of its results."""


def in_groups(queries, entry):
    """Return the number of groups of 64, rows that fill them, and room for the results."""
    groups, (columns, results) = -(-len(queries) // 64), WIDTHS[entry]
    rows, answers = np.zeros((64 * groups, columns), np.float32), np.zeros((64 * groups, results), np.float32)
    rows[: len(queries), : queries.shape[1]] = queries
    return groups, rows, answers


class _Buffer(ctypes.Structure):
    _fields_ = (("data", ctypes.c_void_p), ("count", ctypes.c_size_t))


class _Groups(ctypes.Structure):
    _fields_ = (("first", ctypes.c_uint32 * 3), ("stop", ctypes.c_uint32 * 3))


@pytest.fixture(scope="session")
def programs(exported, compiled):
    """A function that compiles the C++ form of a model, of a fabric, once, and returns a function that runs it on rows.

    That one returns components and bounds, (N, 8), of queries, (N, 12). With the entry point `scatter` it takes random
    numbers beside them, (N, 15), and returns the columns of a Scatter, (N, 16).
    """

    @cache
    def program(model=None, fabric=CLOTH):
        return compiled(exported(fabric, 2, "cpp", model=model) / "cpp" / "evaluate.cpp")

    return program


@pytest.fixture(scope="session")
def compiled(tmp_path_factory):
    """A function that compiles C++ and returns the function of `programs`."""

    def compile_source(source):
        if shutil.which("g++") is None:
            pytest.skip("g++ is not installed")
        library = tmp_path_factory.mktemp("cpp") / "evaluate.so"
        subprocess.run(["g++", "-O2", "-w", "-shared", "-fPIC", "-o", library, source], check=True)
        entries = ctypes.CDLL(str(library))

        def call(buffers, queries, entry="evaluate"):
            count, rows, answers = in_groups(queries, entry)
            arrays = [*(np.ascontiguousarray(values) for values in buffers.values()), rows, answers]
            buffer = (_Buffer * len(arrays))(*(_Buffer(a.ctypes.data, a.size) for a in arrays))
            groups = _Groups((0, 0, 0), (count, 1, 1))
            getattr(entries, entry)(ctypes.byref(groups), None, ctypes.byref(buffer))
            return answers[: len(queries)]

        return call

    return compile_source


@pytest.fixture(scope="session")
def cpp(programs):
    """The function of `programs` for the soft nodes."""
    return programs()


def job_of(buffers, rows, **other):
    columns = {**buffers, "queries": rows}
    encoded = {name: base64.b64encode(values.tobytes()).decode() for name, values in columns.items()}
    return {"names": list(columns), **encoded, "count": len(rows), **other}


def answered(page, folder, jobs, source, *options):
    """Return what a page beside this file answers to jobs with the source of a shader."""
    text = Path(__file__).with_name(page).read_text()
    written = folder / page
    written.write_text(text.replace("JOBS", json.dumps(jobs), 1).replace("SOURCE", json.dumps(source), 1))
    ready = "typeof answers !== 'undefined'"
    with opened(written.as_uri(), folder / "profile", *options, ready=ready) as own:
        return own.run("answers")


@pytest.fixture(scope="session")
def webgl(exported, tmp_path_factory):
    """A function that runs an entry point of the GLSL ES form on the golden queries of cloths; results as for `cpp`.

    For `scatter` the random numbers are 0.5.
    """

    @cache
    def source(entry, folder):
        if entry == "evaluate":
            return (folder / "glsles" / "evaluate.frag").read_text()
        path = tmp_path_factory.mktemp("glsles") / f"{entry}.frag"
        program = Program(path.name, (entry,), stage="fragment")
        compile_program(slangc(), folder / "slang", program, "glsl", path)
        return path.read_text()

    def call(cloths, half=False, entry="evaluate", model=None):
        text = source(entry, exported(CLOTH, 2, "glsles", model=model))
        columns, results = WIDTHS[entry]
        jobs = []
        for cloth in cloths:
            rows = np.full((len(cloth.queries), columns), 0.5, np.float32)
            rows[:, : cloth.queries.shape[1]] = cloth.queries
            values = dict(cloth.buffers)
            for name in {"nodes", "weights"} & values.keys():
                values[name] = values[name].astype(np.float16 if half else np.float32)
            jobs.append(job_of(values, rows, half=half, texels=columns // 4, targets=results // 4))
        answers = answered("evaluate.html", tmp_path_factory.mktemp("webgl"), jobs, text)
        return [np.concatenate([np.reshape(part, (-1, 4)) for part in parts], axis=1) for parts in answers]

    return call


def neumip_folder(folder, fabric, version=1, domain=None, **options):
    """Write a `neumip` whose random textures and perceptrons give components of all sizes."""
    design = NeumipOptions(**options)
    with torch.random.fork_rng():
        torch.manual_seed(3)
        network = NeumipNetwork(design, fabric.weave.repeat)
        weights = {
            name: values + torch.randn_like(values) if name.startswith(("levels", "depth")) else values
            for name, values in network.state_dict().items()
        }
    weights["decoder.6.bias"] = torch.tensor([0.5, 0.2, 1.0, -0.2])
    about = {"optics": fingerprint(fabric.optics()), "repeat": list(fabric.weave.repeat)}
    known = {} if domain is None else {"domain": domain.model_dump(mode="json")}
    card = known | {
        "options": design.model_dump(mode="json", context=IDENTITY),
        "version": {"model": version},
        "fabrics": [about],
    }
    write_model(folder, safetensors.torch.save(weights), card)
    return str(folder)


@pytest.fixture(scope="session")
def neumip(tmp_path_factory):
    """The folder of a trained `neumip`: a repeat of odd sides at the coarser levels, channels that fill no element."""
    return neumip_folder(tmp_path_factory.mktemp("models") / "neumip", load_fabric(CLOTH), texels_per_yarn=5, hidden=18)


def random_folder(folder, network, bias, fabric=None):
    """Write a random network whose answers differ by place and direction; `bias` names that of the last layer."""
    design = network.options
    with torch.no_grad():
        weights = network.state_dict()
        weights[bias][:4] = torch.tensor([1.0, 0.8, 1.2, 1.1])
    about = {"optics": fingerprint(fabric.optics()), "repeat": list(fabric.weave.repeat)} if fabric else {"optics": ""}
    options = design.model_dump(mode="json", context=IDENTITY)
    card = {"options": options, "version": {"model": design.version}, "fabrics": [about]}
    write_model(folder, safetensors.torch.save(weights), card)
    return str(folder)


def woven_folder(folder, **options):
    """Write a random `woven`."""
    with torch.random.fork_rng():
        torch.manual_seed(5)
        network = WovenNetwork(WovenOptions(map_texels=16, encoder_channels=4, **options))
    with torch.no_grad():
        network.decoder.last.weight.mul_(0.1)
    return random_folder(folder, network, "decoder.last.bias")
