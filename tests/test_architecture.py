"""The order of the packages and the place of every heavy library, as the sources and a fresh process show them.

Standard library only, so that this holds before anything is installed that could hide a mistake.
"""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# Imports point to the left (upwards in this list) only.
ORDER = [
    "weaves",
    "pipeline",  # fingerprint, atomic
    "pipeline.truth",
    "pipeline.shards",
    "pipeline.models",
    "pipeline.training",
    "pipeline.scenes",
    "reports",
    "jobs",
]

HOMES = {
    "numba": ["pipeline.truth"],
    "pyarrow": ["pipeline.shards"],
    "torch": ["pipeline.models", "pipeline.training"],
    "onnx": ["pipeline.models"],
    "onnxruntime": ["pipeline.models"],
    "safetensors": ["pipeline.models", "pipeline.training"],
    "colour": ["weaves"],
    "pandas": ["reports"],
    "matplotlib": ["reports"],
    "jinja2": ["reports"],
    "OpenEXR": ["reports"],
    "skimage": ["reports"],
    "flip_evaluator": ["reports"],
    "pyfvvdp": ["reports"],
    "distributed": ["jobs"],
    "dask": ["jobs"],
    "cyclopts": ["jobs"],
    "rich": ["jobs"],
    "trimesh": ["jobs"],
    "mitsuba": ["pipeline.scenes"],
    "drjit": ["pipeline.scenes"],
}

MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in ("weaves", "pipeline", "reports", "jobs")
    for path in sorted((ROOT / package).rglob("*.py"))
}


def imported(path: Path) -> Iterator[str]:
    """Yield every module that a file imports, at its top or inside a function."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, f"{path}: relative imports hide where they point"
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            yield from (name if name in MODULES else node.module for name in inner)


def layer(module: str) -> int:
    """Return a module's place in the order."""
    return max(index for index, package in enumerate(ORDER) if f"{module}.".startswith(f"{package}."))


def ours(module: str) -> bool:
    return module.split(".")[0] in ("weaves", "pipeline", "reports", "jobs")


@pytest.mark.parametrize("module", MODULES)
def test_imports_point_upstream(module):
    wrong = [name for name in imported(MODULES[module]) if ours(name) and layer(name) > layer(module)]
    assert not wrong, f"{module} imports {wrong}, which come after it"


@pytest.mark.parametrize("module", MODULES)
def test_heavy_libraries_stay_at_home(module):
    for name in imported(MODULES[module]):
        homes = HOMES.get(name.split(".")[0])
        at_home = homes is None or any(f"{module}.".startswith(f"{home}.") for home in homes)
        assert at_home, f"{module} imports {name}, which belongs to {homes}"


@pytest.mark.parametrize(
    "code",
    ["from jobs.cli import main; main(['--help'])", "from jobs.plan import plan; from jobs.recipe import load_recipe"],
    ids=["help", "plan"],
)
def test_help_and_plans_load_no_heavy_library(code):
    """`twillight --help` answers in under 0.5 s because nothing heavy is imported; numpy alone takes 0.1 s."""
    heavy = sorted(set(HOMES) - {"cyclopts", "rich"})
    check = f"import sys; print('loaded:', *(name for name in {heavy} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", f"{code}; {check}"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "loaded:"
