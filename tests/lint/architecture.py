"""The order of the packages, the place of every heavy library, and the size of rooms and functions."""

import ast
import re
from collections.abc import Iterator

from tests.lint.tree import DOORS, MODULES, PACKAGES, ROOT, TESTS, Source, bound, graph, module_of, reachable

# Imports point to the left (upwards in this list) only.
ORDER = [
    "weaves", "pipeline", "pipeline.compiled", "pipeline.truth", "pipeline.analytic", "pipeline.materials",
    "pipeline.shards", "pipeline.scenes", "pipeline.bsdf", "pipeline.fitting", "pipeline.models",
    "pipeline.shader", "pipeline.mitsuba", "pipeline.training",
    "reports", "reports.images", "reports.viewer", "reports.exports", "reports.measure", "reports.truth",
    "reports.tables", "reports.page",
    "jobs", "jobs.recipe", "jobs.plan", "jobs.run", "jobs.verbs", "jobs.cli", "jobs.entry",
]  # fmt: skip

LIBRARIES = {
    "weaves": ["colour", "dtx_to_wif"],
    "pipeline.compiled": ["numba"],
    "pipeline.shards": ["pyarrow", "OpenEXR"],
    "pipeline.storage": ["upath", "fsspec", "s3fs"],
    "pipeline.scenes": ["mitsuba", "drjit", "trimesh"],
    "pipeline.mitsuba": ["mitsuba", "drjit"],
    "pipeline.models": ["torch", "onnx", "onnxruntime", "safetensors"],
    "pipeline.training": ["torch", "safetensors"],
    "pipeline.shader": ["PIL"],
    "reports": ["pandas", "matplotlib", "jinja2", "OpenEXR", "skimage", "flip_evaluator", "pyfvvdp"],
    "reports.images": ["av", "PIL"],
    "reports.exports": ["trimesh", "MaterialX", "pygltflib"],
    "jobs": ["distributed", "dask", "cyclopts", "rich"],
}
"""Packages, and the heavy libraries that no others may import."""

HOMES = {name: [home for home, own in LIBRARIES.items() if name in own] for own in LIBRARIES.values() for name in own}

OUTSIDE_TRUTH = {"pipeline.truth.conventions"}
"""Modules of the truth's room that only explain."""

MOST_FILES = 18
MOST_PARAMETERS, MOST_LINES = 12, 100


def within(module: str, packages: list[str]) -> bool:
    return any(f"{module}.".startswith(f"{package}.") for package in packages)


def layer(module: str) -> int:
    return max(index for index, package in enumerate(ORDER) if within(module, [package]))


def wrong_imports(source: Source) -> Iterator[str]:
    """Yield the imports of a module that point downwards, to a door of users or to a library of another room."""
    for name in source.imports:
        library, module = name.split(".")[0], module_of(name)
        if name.startswith("."):
            yield f"{name}: relative imports hide where they point"
        if module in MODULES and layer(module) > layer(source.module):
            yield f"imports {module}, which comes after it"
        if library in {door.module for door in DOORS}:
            yield f"imports {library}, which is for users"
        if library in HOMES and not within(source.module, HOMES[library]):
            yield f"imports {name}, which belongs to {HOMES[library]}"


QUERIES = "pipeline.shards.queries"
"""Draws the random queries of most tests, those of rooms before it too."""


def wrong_imports_of_test(source: Source) -> Iterator[str]:
    """Yield the imports of a test from rooms after its own; a fixture serves all rooms below its folder."""
    room, _, name = source.module.removeprefix("tests.").rpartition(".")
    if name == "conftest":
        last = max(index for index, package in enumerate(ORDER) if within(package, [room]))
    else:
        last = layer(f"{room}.{name}")
    for module in map(module_of, source.imports):
        if module in MODULES and module != QUERIES and layer(module) > last:
            yield f"imports {module}, which comes after what it tests"


def outside_the_reference() -> set[str]:
    """Return modules of the truth that neither its estimator nor its checks need: they belong to `analytic`."""
    starts = ["pipeline.truth.estimator", "pipeline.truth.geometry.opacity", "pipeline.truth.invariants"]
    starts += ["pipeline.truth.scattering.thread_colours"]
    rooms = {module for module, source in MODULES.items() if source.path.name == "__init__.py"}
    return {m for m in MODULES if m.startswith("pipeline.truth.")} - reachable(starts) - rooms - OUTSIDE_TRUTH


def in_circles() -> set[str]:
    left = {module: set(names) for module, names in graph().items()}
    while free := [module for module, names in left.items() if not names & left.keys()]:
        for module in free:
            del left[module]
    return set(left)


def large_rooms() -> Iterator[str]:
    """Yield rooms of too many files, or without a short description."""
    for room in sorted({source.path.parent for source in MODULES.values()}):
        files = [path for path in room.glob("*.py") if path.name != "__init__.py"]
        if len(files) > MOST_FILES:
            yield f"{room.relative_to(ROOT)}: {len(files)} files, at most {MOST_FILES}"
        module = ".".join(room.relative_to(ROOT).parts)
        described = ast.get_docstring(MODULES[module].tree) if module in MODULES else None
        if not described or len(described.splitlines()) > 10:
            yield f"{room.relative_to(ROOT)}: the docstring of its `__init__.py` is missing or longer than 10 lines"


def large_functions() -> Iterator[str]:
    for module, source in MODULES.items():
        for node in source.nodes:
            if isinstance(node, ast.FunctionDef):
                names = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
                lines = (node.end_lineno or 0) - node.lineno + 1
                if len(names) - (names[:1] in (["self"], ["cls"])) > MOST_PARAMETERS or lines > MOST_LINES:
                    yield f"{module}.{node.name}: at most {MOST_PARAMETERS} parameters and {MOST_LINES} lines; split it"


DOTTED = re.compile(r"(?<![\w./-])(?:weaves|pipeline|reports|jobs)(?:\.[A-Za-z_]\w*)+")
"""Full names of modules and of what is in them."""

CONSTANTS = re.compile(r"`([a-z_]\w*)\.([A-Z][A-Z_]*\w*)`")
"""Names in capitals after the last part of a module's name, such as `kernels.SMOOTH`."""

PATHS = re.compile(r"(?<![\w./-])(?:weaves|pipeline|reports|jobs|tests)(?:/[\w.-]*\w)+")
"""Files and folders of the tree."""


def exists(name: str) -> bool:
    """Return whether a dotted name is a module, a name in one, or a member of a class in one."""
    module = module_of(name)
    if module not in MODULES:
        return False
    names = MODULES[module].top
    for part in name.removeprefix(module).split(".")[1:]:
        if part not in names:
            return False
        node = names[part]
        names = bound(node.body) if isinstance(node, ast.ClassDef) else {}
    return True


def missing_names(text: str) -> list[str]:
    """Return the modules, constants of modules and paths that a text names and that do not exist."""
    wrong = [name for name in DOTTED.findall(text) if not exists(name)]
    for stem, name in CONSTANTS.findall(text):
        modules = [module for module in MODULES if module.rpartition(".")[2] == stem]
        if modules and not any(name in MODULES[module].top for module in modules):
            wrong.append(f"{stem}.{name}")
    return wrong + [path for path in PATHS.findall(text) if "NAME" not in path and not (ROOT / path).exists()]


def problems() -> Iterator[str]:
    """Yield a sentence for everything that is out of order."""
    for source in MODULES.values():
        yield from (f"{source.name} {wrong}" for wrong in wrong_imports(source))
    for source in TESTS:
        if source.module.split(".")[1] in PACKAGES[:-1]:  # those of `jobs` and of the whole tree may import all
            yield from (f"{source.name} {wrong}" for wrong in wrong_imports_of_test(source))
    for source in (*DOORS, *MODULES.values(), *TESTS):
        names = missing_names("\n".join(source.prose))
        yield from (f"{source.name}: its docstrings or comments name {name}, which does not exist" for name in names)
    for module in (m for m in MODULES if m.startswith("reports.measure")):
        plotting = {n for m in reachable([module]) for n in MODULES[m].imports} & {"matplotlib", "jinja2"}
        if plotting:
            yield f"{module}: a measurement imports no plotting, this one {sorted(plotting)}"
    yield from (f"{module} is no part of the reference answer: move it" for module in sorted(outside_the_reference()))
    yield from (f"{module} is in a circle of imports" for module in sorted(in_circles()))
    yield from large_rooms()
    yield from large_functions()
