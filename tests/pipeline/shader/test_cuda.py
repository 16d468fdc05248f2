"""The CUDA form on a GPU against the Python: all kinds of golden vectors, and directions drawn as in C++."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.shader.tables import EVERY
from tests.pipeline.shader.conftest import ALIKE, ALLOWED, WIDTHS, check_answers, read, worst

pytestmark = pytest.mark.external  # slangc, nvcc and a GPU

CALLER = Path(__file__).with_name("rows.cu")


def compiled(source, library):
    """Compile the CUDA form with its caller; skip the test if there is no nvcc or no GPU."""
    for program in ("nvcc", "nvidia-smi"):
        if shutil.which(program) is None:
            pytest.skip(f"{program} is not installed")
    # slangc writes it for a compiler at run time: there the declaration of the parameters also defines them.
    text = source.read_text().replace('extern "C" __constant__', "__constant__")
    own = library.with_suffix(".cu")
    own.write_text(text)
    command = ["nvcc", "-O3", "-arch=native", "-w", "-shared", "-Xcompiler", "-fPIC", f'-DSOURCE="{own}"']
    subprocess.run([*command, "-o", library, CALLER], check=True)


def caller(library):
    """Return a function that runs rows of queries by a compiled library."""
    program = ctypes.CDLL(str(library))

    def call(buffers, queries, entry="evaluate"):
        groups, (columns, results) = -(-len(queries) // 64), WIDTHS[entry]
        rows, answers = np.zeros((64 * groups, columns), np.float32), np.zeros((64 * groups, results), np.float32)
        rows[: len(queries), : queries.shape[1]] = queries
        arrays = [*(np.ascontiguousarray(values) for values in buffers.values()), rows]
        fours = [name in ("nodes", "grid", "weights") for name in buffers] + [False]  # four values in an element
        sizes = [-(-a.size // 4) if four else a.size for a, four in zip(arrays, fours, strict=True)]
        error = program.answer_rows(
            int(entry == "scatter"), (ctypes.c_void_p * len(arrays))(*(a.ctypes.data for a in arrays)),
            (ctypes.c_size_t * len(arrays))(*(a.nbytes for a in arrays)), (ctypes.c_size_t * len(arrays))(*sizes),
            len(arrays), answers.ctypes.data_as(ctypes.c_void_p), ctypes.c_size_t(answers.nbytes), groups,
        )  # fmt: skip
        assert error == 0, f"CUDA error {error}"
        return answers[: len(queries)]

    return call


@pytest.fixture(scope="module")
def cuda(exported, tmp_path_factory):
    """The caller of the program of fabrics whose threads do not differ in colour."""
    library = tmp_path_factory.mktemp("cuda") / "rows.so"
    compiled(exported(ALIKE, 2, "cuda") / "cuda" / "evaluate.cu", library)
    return caller(library)


@pytest.mark.parametrize(
    ("name", "level", "kinds"),
    [("denim", 2, ()), ("satin_8", 8, ()), ("voile", 2, ()), ("polyester_lining", 2, (EVERY,))],
)
def test_golden_vectors_are_answered(cuda, exported, name, level, kinds):
    cloth = read(exported(name, level, kinds=kinds))
    answers = cuda(cloth.buffers, cloth.queries)
    check_answers(answers, cloth, ALLOWED["CUDA"])
    rows = np.column_stack([cloth.queries, np.full((len(cloth.queries), 3), 0.5)])
    scattered = cuda(cloth.buffers, rows, "scatter")
    assert worst(scattered[:, [12, 11, 8, 9, 10]], cloth, 8) < ALLOWED["CUDA"]
