"""Exported folders, and the shader compiled as C++ and called from Python."""

import base64
import ctypes
import html
import http.server
import io
import json
import queue
import re
import shutil
import subprocess
import threading
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from pipeline.shader.export_shader import write_shader
from pipeline.shader.languages import Program, compile_program, slangc
from weaves.fabric import load_fabric

FORMAT_PAGE = Path(__file__).parents[3] / "docs" / "shader_format.md"

_ROWS = re.findall(r"^\| ([^|]+) \| ([\d.e-]+) \|$", FORMAT_PAGE.read_text(encoding="utf-8"), re.M)

ALLOWED = {form: float(share) for forms, share in _ROWS for form in forms.split(", ")}
"""Largest difference from golden answers, as a share of the range of a column, as the page promises it to readers."""


def missing(*programs):
    """Return the sentence for what a test needs and is not there, or nothing."""
    there = {"slangc": slangc, "g++": lambda: shutil.which("g++"), "chromium": lambda: shutil.which("chromium")}
    return ", ".join(f"{name} is not installed" for name in programs if there[name]() is None)


@pytest.fixture(scope="session")
def exported(tmp_path_factory):
    """A function that exports a fabric once, and returns its folder; models take no level."""
    home = tmp_path_factory.mktemp("shaders")

    @cache
    def export(name, level=2, *languages, kinds=(), model=None):
        folder = home / "-".join((name, str(level), *languages, *kinds, Path(model or "soft_nodes").name))
        write_shader(load_fabric(name), folder, model, None if model else level, languages, kinds)
        return folder

    return export


@pytest.fixture(scope="session")
def read():
    """A function that reads an exported folder as a program would that has only its files."""

    def read(folder, type_of_numbers="float32"):
        (listing,) = (path for path in folder.glob("*.json") if path.name != "golden.json")
        said = json.loads(listing.read_text())
        codes = {"int32": "<i4", "float32": "<f4", "float16": "<f2"}
        buffers = {}
        for name, buffer in said["buffers"].items():
            kind = type_of_numbers if type_of_numbers in buffer["files"] else next(iter(buffer["files"]))
            path = folder / buffer["files"][kind]
            if kind == "uint8":
                values = np.asarray(Image.open(io.BytesIO(path.read_bytes()))).ravel()
            else:
                values = np.frombuffer(path.read_bytes(), codes[kind])
            count = buffer["elements"] * buffer["channels"]
            assert len(values) >= count and (kind == "uint8" or len(values) == count)
            buffers[name] = values if kind in ("int32", "uint8") else values.astype(np.float32)
        golden = json.loads((folder / said["golden"]).read_text())
        queries = np.array(golden["queries"], np.float32)
        columns = (golden["components"], golden["bounds"], golden["transparency"], golden["density"])
        answers = np.column_stack([np.array(column) for column in columns if column])
        return SimpleNamespace(said=said, buffers=buffers, queries=queries, answers=answers, groups=golden["groups"])

    return read


WIDTHS = {"evaluate": (12, 8), "scatter": (16, 16)}
"""Columns of the rows of each entry point, and of its results."""


class _Buffer(ctypes.Structure):
    _fields_ = (("data", ctypes.c_void_p), ("count", ctypes.c_size_t))


class _Groups(ctypes.Structure):
    _fields_ = (("first", ctypes.c_uint32 * 3), ("stop", ctypes.c_uint32 * 3))


@pytest.fixture(scope="session")
def cpp(exported, tmp_path_factory):
    """A function that runs an entry point of the C++ form on rows: components and bounds, (N, 8), of queries, (N, 12).

    `scatter` takes random numbers beside them, (N, 15), and returns the columns of a Scatter, (N, 16).
    """
    if lacking := missing("slangc", "g++"):
        pytest.skip(lacking)
    return compiled(exported("gingham", 2, "cpp"), tmp_path_factory.mktemp("cpp"))


def compiled(exported, folder):
    """Compile the C++ form of an exported folder into another, and return the function of the fixture `cpp`."""
    library, source = folder / "evaluate.so", exported / "cpp" / "evaluate.cpp"
    subprocess.run(["g++", "-O2", "-w", "-shared", "-fPIC", "-o", library, source], check=True)
    programs = ctypes.CDLL(str(library))

    def call(buffers, queries, entry="evaluate"):
        count, (columns, results) = -(-len(queries) // 64), WIDTHS[entry]
        rows, answers = np.zeros((64 * count, columns), np.float32), np.zeros((64 * count, results), np.float32)
        rows[: len(queries), : queries.shape[1]] = queries
        arrays = [np.ascontiguousarray(values) for values in buffers.values()]
        arrays += [rows, answers]
        buffer = (_Buffer * len(arrays))(*(_Buffer(a.ctypes.data, a.size) for a in arrays))
        groups = _Groups((0, 0, 0), (count, 1, 1))
        getattr(programs, entry)(ctypes.byref(groups), None, ctypes.byref(buffer))
        return answers[: len(queries)]

    return call


@pytest.fixture(scope="session")
def webgl(exported, tmp_path_factory):
    """A function that runs an entry point of the GLSL ES form on the golden queries of cloths; results as for `cpp`.

    For `scatter` the random numbers are 0.5.
    """
    if lacking := missing("slangc", "chromium"):
        pytest.skip(lacking)
    page = Path(__file__).with_name("evaluate.html").read_text()

    @cache
    def source(entry, folder):
        if entry == "evaluate":
            return (folder / "glsles" / "evaluate.frag").read_text()
        path = tmp_path_factory.mktemp("glsles") / f"{entry}.frag"
        program = Program(path.name, "evaluate.slang", (entry,), "fragment", True)
        compile_program(slangc(), folder / "slang", program, "glsl", path)
        return path.read_text()

    def call(cloths, half=False, entry="evaluate", folder=None):
        text = source(entry, folder or exported("gingham", 2, "glsles"))
        columns, results = WIDTHS[entry]
        jobs = []
        for cloth in cloths:
            rows = np.full((len(cloth.queries), columns), 0.5, np.float32)
            rows[:, : cloth.queries.shape[1]] = cloth.queries
            values = {**cloth.buffers, "queries": rows}
            for name in {"nodes", "weights"} & values.keys():
                values[name] = values[name].astype(np.float16 if half else np.float32)
            encoded = {name: base64.b64encode(array.tobytes()).decode() for name, array in values.items()}
            jobs.append(
                {
                    "names": list(values),
                    **encoded,
                    "count": len(rows),
                    "half": half,
                    "texels": columns // 4,
                    "targets": results // 4,
                }
            )
        written = tmp_path_factory.mktemp("webgl") / "evaluate.html"
        written.write_text(page.replace("JOBS", json.dumps(jobs), 1).replace("SOURCE", json.dumps(text), 1))
        command = ["chromium", "--headless", "--no-sandbox", "--dump-dom", f"--user-data-dir={written.parent}"]
        done = subprocess.run([*command, written.as_uri()], capture_output=True, text=True, timeout=600, check=True)
        shown = re.search(r'<pre id="answers">(.*?)</pre>', done.stdout, re.DOTALL)
        assert shown, done.stdout[-1000:]
        text = html.unescape(shown[1])
        assert text.startswith("["), text
        return [np.concatenate([np.reshape(part, (-1, 4)) for part in answer], axis=1) for answer in json.loads(text)]

    return call


class _Handler(http.server.SimpleHTTPRequestHandler):
    """A folder for a browser, which posts what it has found."""

    posted: queue.Queue = queue.Queue()

    def do_POST(self):
        self.posted.put(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(204)
        self.end_headers()

    def log_message(self, *_):
        pass


@pytest.fixture
def browse(tmp_path):
    """A function that opens a page of a folder in a browser, and returns what the page posts."""
    handler = partial(_Handler, directory=tmp_path)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield partial(_posted, tmp_path, f"http://127.0.0.1:{server.server_port}")
        server.shutdown()


def _posted(folder, address, page, *options):
    command = ["chromium", "--headless", "--no-sandbox", "--remote-debugging-port=0", *options]
    command += [f"--user-data-dir={folder / 'profile'}", f"{address}/{page}"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as browser:
        try:
            return _Handler.posted.get(timeout=240)
        finally:
            browser.terminate()
