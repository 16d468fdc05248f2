"""The order of the packages and the place of every heavy library, as the sources and a fresh process show them.

Standard library only, so that this holds before anything is installed that could hide a mistake.
"""

import ast
import re
import subprocess
import sys
import tokenize
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

# Imports point to the left (upwards in this list) only.
ORDER = [
    "weaves",
    "pipeline",  # fingerprint, atomic, folders
    "pipeline.compiled",
    "pipeline.truth",
    "pipeline.analytic",
    "pipeline.materials",
    "pipeline.shards",
    "pipeline.scenes",
    "pipeline.models",
    "pipeline.shader",
    "pipeline.mitsuba",
    "pipeline.training",
    "reports",  # record, options
    "reports.images",
    "reports.viewer",
    "reports.measure",
    "reports.truth",
    "reports.tables",
    "reports.page",
    "jobs",
    "jobs.recipe",
    "jobs.plan",
    "jobs.run",
    "jobs.verbs",
    "jobs.cli",
    "jobs.entry",
]

HOMES = {
    "numba": ["pipeline.compiled"],
    "pyarrow": ["pipeline.shards"],
    "torch": ["pipeline.models", "pipeline.training"],
    "onnx": ["pipeline.models"],
    "onnxruntime": ["pipeline.models"],
    "safetensors": ["pipeline.models", "pipeline.training"],
    "colour": ["weaves"],
    "dtx_to_wif": ["weaves"],
    "pandas": ["reports"],
    "matplotlib": ["reports"],
    "jinja2": ["reports"],
    "OpenEXR": ["reports"],
    "av": ["reports.images"],
    "PIL": ["pipeline.shader", "reports.images"],
    "skimage": ["reports"],
    "flip_evaluator": ["reports"],
    "pyfvvdp": ["reports"],
    "distributed": ["jobs"],
    "upath": ["pipeline.storage"],
    "fsspec": ["pipeline.storage"],
    "s3fs": ["pipeline.storage"],
    "dask": ["jobs"],
    "cyclopts": ["jobs"],
    "rich": ["jobs"],
    "trimesh": ["jobs"],
    "MaterialX": ["jobs"],
    "pygltflib": ["jobs"],
    "mitsuba": ["pipeline.scenes", "pipeline.mitsuba"],
    "drjit": ["pipeline.scenes", "pipeline.mitsuba"],
}

DOORS = [ROOT / "twillight.py", ROOT / "twillight_mitsuba.py"]
"""Modules for users, which no other imports."""

MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for package in ("weaves", "pipeline", "reports", "jobs")
    for path in sorted((ROOT / package).rglob("*.py"))
}


@cache
def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def imported(path: Path) -> list[str]:
    """Return every module that a file imports, at its top or inside a function."""
    found: list[str] = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0 and node.module, f"{path}: relative imports hide where they point"
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            found += [name if name in MODULES else node.module for name in inner]
    return found


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
def test_nothing_imports_the_doors_of_users(module):
    assert not {path.stem for path in DOORS} & {name.split(".")[0] for name in imported(MODULES[module])}


TESTS = {
    ".".join(path.relative_to(ROOT / "tests").with_suffix("").parts): path
    for package in ("weaves", "pipeline", "reports")
    for path in sorted((ROOT / "tests" / package).rglob("*.py"))
}
"""Tests by the module that they would be beside it; those of `jobs` and of the whole tree may import all."""

QUERIES = "pipeline.shards.queries"
"""Draws the random queries of most tests, those of rooms before it too."""


def last_layer(test: str) -> int:
    """Return the last place in the order that a test may import from; fixtures serve all rooms below their folder."""
    room, _, name = test.rpartition(".")
    if name != "conftest":
        return layer(test)
    return max(index for index, package in enumerate(ORDER) if f"{package}.".startswith(f"{room}."))


@pytest.mark.parametrize("test", TESTS)
def test_tests_import_nothing_from_rooms_further_down(test):
    names = [name for name in imported(TESTS[test]) if ours(name) and name != QUERIES]
    wrong = [name for name in names if layer(name) > last_layer(test)]
    assert not wrong, f"tests/{test.replace('.', '/')}.py imports {wrong}, which come after what it tests"


@pytest.mark.parametrize("module", MODULES)
def test_heavy_libraries_stay_at_home(module):
    for name in imported(MODULES[module]):
        homes = HOMES.get(name.split(".")[0])
        at_home = homes is None or any(f"{module}.".startswith(f"{home}.") for home in homes)
        assert at_home, f"{module} imports {name}, which belongs to {homes}"


GRAPH = {module: sorted({name for name in imported(path) if name in MODULES}) for module, path in MODULES.items()}


def reachable(starts: list[str]) -> set[str]:
    """Return the modules that these import, directly or not, and themselves."""
    found, left = set(), list(starts)
    while left:
        if (module := left.pop()) not in found:
            found.add(module)
            left += GRAPH[module]
    return found


def test_all_of_truth_is_reached_from_its_estimator_checks_and_opacity():
    starts = [m for m in MODULES if m.startswith("pipeline.truth.checks.")]
    starts += [
        "pipeline.truth.estimator",
        "pipeline.truth.geometry.opacity",
        "pipeline.truth.scattering.thread_colours",
    ]
    reached = reachable(starts)
    rooms = {m for m, path in MODULES.items() if path.name == "__init__.py"}
    aside = {m for m in MODULES if m.startswith("pipeline.truth.")} - reached - rooms - {"pipeline.truth.conventions"}
    assert not aside, f"{sorted(aside)} are no part of the reference answer: they belong to pipeline.analytic"


@pytest.mark.parametrize("module", [m for m in MODULES if m.startswith("reports.measure")])
def test_a_measurement_imports_no_plotting(module):
    plotting = {"matplotlib", "jinja2"}
    wrong = {m: sorted(plotting & {n.split(".")[0] for n in imported(MODULES[m])}) for m in reachable([module])}
    assert not any(wrong.values()), {m: names for m, names in wrong.items() if names}


def test_no_modules_import_each_other_in_a_circle():
    left = {module: set(names) - {module} for module, names in GRAPH.items()}
    while done := [module for module, names in left.items() if not names & left.keys()]:
        for module in done:
            del left[module]
    assert not left, f"circles among {sorted(left)}"


@pytest.mark.parametrize("room", sorted({path.parent for path in MODULES.values()}), ids=lambda room: str(room.name))
def test_rooms_are_small_and_say_what_is_in_them(room):
    files = [path for path in room.glob("*.py") if path.name != "__init__.py"]
    assert len(files) <= (7 if room == ROOT / "pipeline" / "truth" else 18), f"{room}: {len(files)} files"
    described = ast.get_docstring(ast.parse((room / "__init__.py").read_text(encoding="utf-8")))
    assert described and len(described.splitlines()) <= 10, f"{room}: its docstring is missing or too long"


SOURCES = [*DOORS, *MODULES.values(), *sorted((ROOT / "tests").rglob("*.py"))]
"""Files whose docstrings and comments may name modules."""

DOTTED = re.compile(r"(?<![\w./-])(?:weaves|pipeline|reports|jobs)(?:\.[A-Za-z_]\w*)+")
"""Full names of modules and of what is in them."""

CONSTANTS = re.compile(r"`([a-z_]\w*)\.([A-Z][A-Z_]*\w*)`")
"""Names in capitals after the last part of a module's name, such as `kernels.SMOOTH`."""

PATHS = re.compile(r"(?<![\w./-])(?:weaves|pipeline|reports|jobs|tests)(?:/[\w.-]*\w)+")
"""Files and folders of the tree."""


def defined(body: list[ast.stmt]) -> dict[str, ast.stmt]:
    """Return the names that statements of a module or class bind, each with its statement."""
    found: dict[str, ast.stmt] = {}
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found[node.name] = node
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            found |= {(alias.asname or alias.name).split(".")[0]: node for alias in node.names}
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            found |= {name.id: node for name in ast.walk(node) if isinstance(name, ast.Name)}
        elif isinstance(node, (ast.If, ast.Try, ast.For, ast.With)):
            found |= defined(node.body)
    return found


TOP = {module: defined(parsed(path).body) for module, path in MODULES.items()}


def exists(name: str) -> bool:
    """Return whether a dotted name is a module, a name in one, or a member of a class in one."""
    parts = name.split(".")
    length = next(n for n in range(len(parts), 0, -1) if ".".join(parts[:n]) in MODULES)
    names = TOP[".".join(parts[:length])]
    for part in parts[length:]:
        if part not in names:
            return False
        node = names[part]
        names = defined(node.body) if isinstance(node, ast.ClassDef) else {}
    return True


def missing_names(text: str) -> list[str]:
    """Return the modules, constants of modules and paths that a text names and that do not exist."""
    wrong = [name for name in DOTTED.findall(text) if not exists(name)]
    for stem, name in CONSTANTS.findall(text):
        modules = [module for module in MODULES if module.rpartition(".")[2] == stem]
        if modules and not any(name in TOP[module] for module in modules):
            wrong.append(f"{stem}.{name}")
    return wrong + [path for path in PATHS.findall(text) if "NAME" not in path and not (ROOT / path).exists()]


def prose(path: Path) -> str:
    """Return the docstrings and comments of a file."""
    with path.open("rb") as file:
        comments = [token.string for token in tokenize.tokenize(file.readline) if token.type == tokenize.COMMENT]
    nodes = (node.value for node in ast.walk(parsed(path)) if isinstance(node, ast.Expr))
    strings = [node.value for node in nodes if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return "\n".join(strings + comments)


def test_names_in_docstrings_and_comments_exist():
    wrong = {str(path.relative_to(ROOT)): missing_names(prose(path)) for path in SOURCES}
    assert not any(wrong.values()), {path: names for path, names in wrong.items() if names}


@pytest.mark.parametrize(
    ("text", "wrong"),
    [
        ("see pipeline.truth.query", []),
        ("`pipeline.truth.query.Queries.take`, then", []),
        ("`pipeline.truth.query.Queries.asked`", ["pipeline.truth.query.Queries.asked"]),
        ("(pipeline.truth.sums)", ["pipeline.truth.sums"]),
        ("`kernels.SMOOTH`", []),
        ("`kernels.ROUGH`", ["kernels.ROUGH"]),
        ("tests/fits and pipeline/atomic.py.", []),
        ("tests/fit", ["tests/fit"]),
    ],
)
def test_the_search_for_missing_names_can_fail(text, wrong):
    assert missing_names(text) == wrong


MOST_PARAMETERS, MOST_LINES = 12, 100

LARGER = {
    "pipeline.analytic.soft_nodes.shade.shade_node",
    "pipeline.analytic.soft_nodes.shade.shade_fixed",
    "pipeline.analytic.soft_nodes.shade.shade_footprint",
}
"""Kernels that still exceed the limit; whether bundled arguments cost them speed is open (reports/LOG.md)."""


def test_functions_have_few_parameters_and_lines():
    larger = set()
    for module, path in MODULES.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef):
                names = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
                lines = node.end_lineno - node.lineno + 1
                if len(names) - (names[:1] in (["self"], ["cls"])) > MOST_PARAMETERS or lines > MOST_LINES:
                    larger.add(f"{module}.{node.name}")
    limits = f"{MOST_PARAMETERS} parameters and {MOST_LINES} lines at most"
    assert not larger - LARGER, f"{sorted(larger - LARGER)}: {limits}; pass named tuples, or split them"
    assert not LARGER - larger, f"{sorted(LARGER - larger)} keep the limits now: take them off the list"


@pytest.mark.parametrize(
    "code",
    [
        "from jobs.cli import main; main(['--help'])",
        "from jobs.plan.plan import plan; from jobs.recipe.load import load_recipe",
    ],
    ids=["help", "plan"],
)
def test_help_and_plans_load_no_heavy_library(code):
    """`twillight --help` answers in under 0.5 s because nothing heavy is imported; numpy alone takes 0.1 s."""
    heavy = sorted(set(HOMES) - {"cyclopts", "rich"})
    check = f"import sys; print('loaded:', *(name for name in {heavy} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", f"{code}; {check}"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "loaded:"
