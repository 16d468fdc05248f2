"""The CUDA form on a GPU against the Python."""

import ctypes
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pipeline.shader.tables import EVERY
from tests.pipeline.shader.conftest import ALIKE, ALLOWED, apart, check_answers, in_groups, read

pytestmark = pytest.mark.external  # slangc, nvcc and a GPU


@pytest.fixture(scope="module")
def cuda(exported, tmp_path_factory):
    """A function that runs rows of queries by the program of fabrics whose threads do not differ in colour."""
    for needed in ("nvcc", "nvidia-smi"):
        if shutil.which(needed) is None:
            pytest.skip(f"{needed} is not installed")
    source = exported(ALIKE, 2, "cuda") / "cuda" / "evaluate.cu"
    # slangc writes it for a compiler at run time: there the declaration of the parameters also defines them.
    source.write_text(source.read_text().replace('extern "C" __constant__', "__constant__"))
    library = tmp_path_factory.mktemp("cuda") / "rows.so"
    command = ["nvcc", "-O3", "-arch=native", "-w", "-shared", "-Xcompiler", "-fPIC", f'-DSOURCE="{source}"']
    subprocess.run([*command, "-o", library, Path(__file__).with_name("rows.cu")], check=True)
    program = ctypes.CDLL(str(library))

    def call(buffers, queries, entry="evaluate"):
        groups, rows, answers = in_groups(queries, entry)
        arrays = [*(np.ascontiguousarray(values) for values in buffers.values()), rows]
        fours = [name in ("nodes", "grid") for name in buffers] + [False]  # four values in an element
        sizes = [-(-a.size // 4) if four else a.size for a, four in zip(arrays, fours, strict=True)]
        pointers = (ctypes.c_void_p * len(arrays))(*(a.ctypes.data for a in arrays))
        lengths = (ctypes.c_size_t * (2 * len(arrays)))(*(a.nbytes for a in arrays), *sizes)
        result = ctypes.c_void_p(answers.ctypes.data), ctypes.c_size_t(answers.nbytes)
        assert program.answer_rows(entry == "scatter", pointers, lengths, len(arrays), *result, groups) == 0
        return answers[: len(queries)]

    return call


@pytest.mark.parametrize(
    ("name", "level", "kinds"),
    [("denim", 2, ()), ("satin_8", 8, ()), ("voile", 2, ()), ("polyester_lining", 2, (EVERY,))],
)
def test_golden_vectors_are_answered(cuda, exported, name, level, kinds):
    cloth = read(exported(name, level, kinds=kinds))
    check_answers(cuda(cloth.buffers, cloth.queries), cloth, ALLOWED["CUDA"])
    rows = np.column_stack([cloth.queries, np.full((len(cloth.queries), 3), 0.5)])
    assert apart(cuda(cloth.buffers, rows, "scatter")[:, [12, 11, 8, 9, 10]], cloth, 8) < ALLOWED["CUDA"]
