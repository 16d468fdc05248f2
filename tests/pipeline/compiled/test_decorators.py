"""What a kernel computes does not depend on who compiled it, when, or what was compiled before.

Kernels of a small copy in fresh processes: the first of them compile, the others read the cache, and every process uses
the kernels in an order of its own.
"""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
IGNORED = shutil.ignore_patterns("__pycache__")

# `smooth` sums 48 products and is too long to be built into each of its callers; `plain` allows no regrouping and calls
# the same function as `fast`, with an operation that numba writes in Python (`x**2`).
KERNELS = """
import numpy as np
from pipeline.compiled.decorators import allocating_kernel, fast_kernel, inlined_kernel, kernel

@kernel
def shared(x):
    total = np.float32(0)
    for k in range(len(x)):
        total += x[k] * x[k] + x[k]
    return total

@fast_kernel
def inverse_length(x, y, z):
    return np.float32(1) / (x**2 + y**2 + z**2)

@fast_kernel
def fast(x):
    total = shared(x)
    for k in range(len(x) - 2):
        total += inverse_length(x[k], x[k + 1], x[k + 2])
    return total

@kernel
def plain(x):
    total = shared(x)
    for k in range(len(x) - 2):
        total += x[k] ** 2 + x[k + 2] ** 2 * np.float32(0.7)
    return total

@fast_kernel
def smooth(x, out):
    for j in range(len(out)):
        out[j] = np.float32(0)
        for k in range(len(x)):
            out[j] += x[k] * x[k] * np.float32(1.1) + x[k] / np.float32(3) + out[j] * np.float32(0.01)
        for k in range(len(x) - 1):
            out[j] += np.sqrt(abs(x[k] * x[k + 1] + np.float32(0.3) * x[k] * x[j])) / (np.float32(1.7) + x[k] * x[k])

@allocating_kernel
def twice(x):
    out = np.zeros(5, np.float32)
    smooth(x[:48], out)
    first = out.sum()
    smooth(x[7:48], out)
    smooth(x[3:], out[1:4])
    return first + out.sum()
"""

ANSWERS = """
import hashlib
import sys
import numpy as np
from pipeline.truth import small

x = (np.random.default_rng(5).random(61) - 0.3).astype(np.float32)
def smooth():
    out = np.zeros(5, np.float32)
    small.smooth(x, out)
    return out
asked = {name: (lambda name=name: getattr(small, name)(x)) for name in ("fast", "plain", "twice", "shared")}
asked["smooth"] = smooth
answers = {name: asked[name]() for name in sys.argv[1:]}
for name in sorted(answers):
    print(name, hashlib.sha256(np.ascontiguousarray(answers[name]).tobytes()).hexdigest())
"""


def start(root: Path, script: str, *order: str) -> subprocess.Popen[str]:
    """Start a fresh process that asks the kernels under `root` in this order."""
    environment = os.environ | {"PYTHONPATH": str(root), "NUMBA_NUM_THREADS": "1"}
    command = [sys.executable, "-c", script, *order]
    return subprocess.Popen(command, env=environment, cwd=root, text=True, stdout=subprocess.PIPE)


def answers(process: subprocess.Popen[str]) -> str:
    """Return what it printed, one kernel a line, sorted by name."""
    out, _ = process.communicate()
    assert process.returncode == 0
    return out


@pytest.fixture(autouse=True)
def _caches_of_their_own(monkeypatch):
    """Copies of the tree compile their kernels themselves."""
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)


@pytest.fixture
def copies(tmp_path: Path) -> list[Path]:
    """Return three folders with the decorators and small kernels, nothing compiled."""
    folders = [tmp_path / name for name in "abc"]
    for pipeline in (folder / "pipeline" for folder in folders):
        shutil.copytree(ROOT / "pipeline" / "compiled", pipeline / "compiled", ignore=IGNORED)
        (pipeline / "truth").mkdir()
        for package in (pipeline, pipeline / "truth"):
            (package / "__init__.py").touch()
        (pipeline / "truth" / "small.py").write_text(KERNELS)
    return folders


CACHED = """
import os
import re
import sys
from pathlib import Path
import numpy as np
from pipeline.compiled.decorators import announced
from pipeline.truth import small

x, names = np.ones(61, np.float32), []
if (child := os.fork()) == 0:
    small.plain(x)
    os._exit(0)
print("child", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
with announced(names.append):
    small.fast(x)
print(*sorted({name.rpartition("-")[0].rpartition(".")[2] for name in names}))
small.twice(x)
(code,) = small.twice.inspect_asm().values()
print("call" in code and "smooth" in code, *re.findall(r"[.]weak\\s+(\\S+)", code))
print(*(result.library._loaded for result in small.smooth.overloads.values()))
small.smooth(x, np.zeros(5, np.float32))
print(*(result.library._loaded for result in small.smooth.overloads.values()))
print(*sorted(f"{path.name}:{path.stat().st_mtime_ns}" for path in Path(sys.argv[1]).rglob("*.nbc")))
"""


def test_copies_of_the_tree_and_forks_share_kernels_that_run_their_own_copies(copies, tmp_path, monkeypatch):
    """Each kernel is announced when it is compiled; a child of a fork compiles too. A weak function is one that the
    linker replaces by whatever of its name came into the process first. `smooth` has machine code only after Python has
    called it."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    first, second = (answers(start(copy, CACHED, str(tmp_path / "kernels"))) for copy in copies[:2])
    *lines, compiled = first.splitlines()
    assert lines == ["child 0", "fast inverse_length shared", "True", "False", "True"]
    assert second.splitlines()[-1] == compiled and len(compiled.split()) == 7
    assert not list(copies[0].rglob("*.nbc"))


def test_a_process_in_which_a_file_changes_leaves_no_kernel_of_the_old_file(copies):
    """The caller is imported later than the file that it calls, and after the change of it."""
    truth = copies[0] / "pipeline" / "truth"
    head = "from pipeline.compiled.decorators import kernel\n"
    body = "@kernel\ndef {}():\n    return {}\n"
    (truth / "called.py").write_text(head + body.format("called", 1))
    caller = f"from pipeline.truth.called import called\n{head}{body.format('caller', 'called()')}"
    (truth / "caller.py").write_text(caller)
    edit = """
from pathlib import Path
from pipeline.truth import called

path = Path(called.__file__)
path.write_text(path.read_text().replace("1", "22"))
"""
    use = "from pipeline.truth.caller import caller\nprint(caller())"
    assert [answers(start(copies[0], script)) for script in (edit + use, use)] == ["1\n", "22\n"]


ARRAYS = """
import numpy as np
from pipeline.compiled.decorators import allocating_kernel, kernel

@kernel
def total(x, first, last):
    part, sum_ = x[first:last], 0.0
    for k in range(len(part)):
        sum_ += part[k] ** 2
    return sum_

@allocating_kernel
def totals(x, rows):
    found = np.zeros(rows)
    for k in range(rows):
        found[k] = total(x[k], k, k + 2)
    return found

@kernel
def slice_of(x):
    return x[1:3]

@kernel
def slice_in_a_tuple(x):
    return 1, (x[1:3], 2)

@kernel
def allocates(x):
    return np.zeros(3)[0] + x[0]
"""


def test_arrays_are_counted_where_they_are_made_and_nowhere_else(copies):
    (copies[0] / "pipeline" / "truth" / "small.py").write_text(ARRAYS)
    script = """
import sys
import numba
import numpy as np
from pipeline.truth.small import *

x = np.arange(20.0).reshape(4, 5)
before = sys.getrefcount(x), sys.getrefcount(row := x[0])
made = totals(x, 4)
assert np.array_equal(made, [(x[k, k : k + 2] ** 2).sum() for k in range(4)])
assert total(row, 1, 3) == 5 and (sys.getrefcount(x), sys.getrefcount(row)) == before
print("NRT_incref" in "".join(total.inspect_llvm().values()), "NRT_MemInfo" in "".join(totals.inspect_llvm().values()))
for wrong in (slice_of, slice_in_a_tuple, allocates):
    try:
        print(wrong(row))
    except (TypeError, numba.errors.NumbaError):
        print("refused")
"""
    assert answers(start(copies[0], script)).split() == ["False", "True", *["refused"] * 3]


def test_kernels_that_borrow_arrays_call_none_that_returns_them():
    """The caller would have to release such an array, and does not count."""
    decorated = {}
    for path in (ROOT / "pipeline").rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.decorator_list:
                decorators = {ast.unparse(decorator) for decorator in node.decorator_list}
                if any(name.endswith("kernel") for name in decorators):
                    decorated[path, node.name] = node, "allocating_kernel" in decorators
    assert len(decorated) > 150
    makers = {
        name
        for (_, name), (node, allocates) in decorated.items()
        if allocates and ast.unparse(node.returns) not in ("None", "int", "float", "bool")
    }
    assert "_horizons" in makers and "refine" not in makers
    for (path, name), (node, allocates) in decorated.items():
        if not allocates:
            calls = (call.func for call in ast.walk(node) if isinstance(call, ast.Call))
            called = {function.id for function in calls if isinstance(function, ast.Name)}
            assert not called & makers, f"{path}: {name} calls {called & makers}"


@pytest.mark.slow
def test_kernels_answer_the_same_cold_and_warm_in_any_order(copies):
    order = ("fast", "plain", "twice", "smooth", "shared")
    cold = answers(start(copies[0], ANSWERS, *order))
    assert len(cold.split()) == 2 * len(order)
    assert answers(start(copies[0], ANSWERS, *order[::-1])) == cold
    assert answers(start(copies[1], ANSWERS, *order[::-1])) == cold
    together = [start(copies[2], ANSWERS, *order), start(copies[2], ANSWERS, *order[::-1])]
    assert [answers(process) for process in together] == [cold, cold]
