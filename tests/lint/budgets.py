"""Sizes of the code that only fall; their limits are in pyproject.toml, `[tool.budgets]`."""

import ast
import json
import re
import tomllib
from collections import Counter
from collections.abc import Iterator

from tests.lint.tree import ASIDE, DOORS, MODULES, ROOT, TESTS, Source, module_of

PROJECT = ROOT / "pyproject.toml"

PRODUCT = [*DOORS, *MODULES.values()]

START = [("jobs.verbs.run", "work"), ("jobs.plan.page", "Page")]
"""The verb that runs a recipe, and the task that writes its page."""

STEPS = ("jobs.plan.", "jobs.run.", "jobs.verbs.run.")
"""Rooms between a recipe and its page."""

VAGUE = {"found", "said", "one"}
"""Names of variables that say nothing."""

Definition = ast.FunctionDef | ast.ClassDef


def public(source: Source) -> list[Definition]:
    body = source.tree.body
    return [node for node in body if isinstance(node, Definition) and not node.name.startswith("_")]


def twice(names: Iterator[str]) -> list[str]:
    return sorted(name for name, count in Counter(names).items() if count > 1)


def constant_names() -> list[str]:
    return twice(
        name
        for source in PRODUCT
        for name, node in source.top.items()
        if name.isupper() and not name.startswith("_") and isinstance(node, (ast.Assign, ast.AnnAssign))
        if any(
            isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store) and part.id == name
            for part in ast.walk(node)
        )
    )


def vague_variables() -> int:
    """Count the places where a variable gets a name that says nothing."""
    stored = (node for source in PRODUCT for node in source.nodes if isinstance(node, ast.Name))
    return sum(node.id in VAGUE and isinstance(node.ctx, ast.Store) for node in stored)


def option_fields() -> int:
    """Count the fields of options: pydantic classes called `…Options`, and those of recipes and populations."""
    classes = [(source, node) for source in PRODUCT for node in source.nodes if isinstance(node, ast.ClassDef)]
    bases = {node.name: {ast.unparse(base).rpartition(".")[2] for base in node.bases} for _, node in classes}

    def is_model(name: str, seen: frozenset[str] = frozenset()) -> bool:
        return name == "BaseModel" or any(is_model(base, seen | {name}) for base in bases.get(name, set()) - seen)

    return sum(
        isinstance(part, ast.AnnAssign) and "ClassVar" not in ast.unparse(part.annotation)
        for source, node in classes
        if node.name.endswith("Options") or source.path.stem in ("options", "recipe", "population")
        if is_model(node.name)
        for part in node.body
    )


def steps() -> int:
    """Count the public functions and classes that a walk from name to name meets between a recipe and its page."""
    met, left = set(), list(START)
    while left:
        module, name = left.pop()
        source = MODULES.get(module)
        if (module, name) in met or source is None or not f"{module}.".startswith(STEPS):
            continue
        node = source.top.get(name)
        if isinstance(node, (ast.Import, ast.ImportFrom)) or node is None:
            continue
        met.add((module, name))
        left += names_in(source, node)
    return sum(isinstance(MODULES[m].top[name], Definition) and not name.startswith("_") for m, name in met)


def names_in(source: Source, node: ast.AST) -> Iterator[tuple[str, str]]:
    """Yield the module and the name of everything that code of a module names."""
    origin = {}
    for part in source.nodes:
        if isinstance(part, ast.ImportFrom):
            origin |= {alias.asname or alias.name: f"{part.module}.{alias.name}" for alias in part.names}
    for part in ast.walk(node):
        if isinstance(part, ast.Name):
            full = origin.get(part.id, f"{source.module}.{part.id}")
        elif isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name) and part.value.id in origin:
            full = f"{origin[part.value.id]}.{part.attr}"
        else:
            continue
        module = module_of(full)
        if module != full and module in MODULES:
            yield module, full.removeprefix(f"{module}.").split(".")[0]


def files_of_a_metric() -> int:
    """Count the files that the recipe of CONTRIBUTING.md for a metric changes."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (section,) = re.findall(r"^### A metric\n(.*?)^##", text, re.M | re.S)
    return len(set(re.findall(r"^`(\S+)`:$", section, re.M)))


def tests() -> int:
    """Return the number of tests of the last whole `make test` here, or 0."""
    counted = ROOT / ".pytest_cache/v/budgets/tests"
    return int(json.loads(counted.read_text())) if counted.exists() else 0


def measured() -> dict[str, tuple[str, int]]:
    classes = (node.name for source in PRODUCT for node in public(source) if isinstance(node, ast.ClassDef))
    outside, lines = (*PRODUCT, *ASIDE), [len(source.text.splitlines()) for source in (*PRODUCT, *ASIDE)]
    return {
        "lines": ("lines of .py outside tests", sum(lines)),
        "lines_of_code": ("of these, of code", sum(source.lines_of_code for source in outside)),
        "files": ("files of .py outside tests", len(outside)),
        "public_names": ("public functions and classes", sum(len(public(source)) for source in PRODUCT)),
        "option_fields": ("fields of options", option_fields()),
        "class_names_twice": ("names of several public classes", len(twice(classes))),
        "constant_names_twice": ("names of constants of several modules", len(constant_names())),
        "vague_variables": ("variables called found, said or one", vague_variables()),
        "steps": ("names from a recipe to its page", steps()),
        "files_of_a_metric": ("files to add a metric", files_of_a_metric()),
        "tests": ("tests of `make test`, when it last ran", tests()),
        "lines_of_tests": ("lines of tests", sum(len(source.text.splitlines()) for source in TESTS)),
    }


def limits() -> dict[str, int]:
    stored: dict[str, int] = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["tool"]["budgets"]
    return stored


def lower() -> None:
    """Write what is reached as the limit of each budget that is above it."""
    text, stored = PROJECT.read_text(encoding="utf-8"), limits()
    head, table_head, table_body = text.partition("[tool.budgets]\n")
    for key, (_, now) in measured().items():
        if 0 < now < stored[key] or (now == 0 and key != "tests"):
            table_body = re.sub(rf"^{key} = .*$", f"{key} = {now}", table_body, count=1, flags=re.M)
    PROJECT.write_text(head + table_head + table_body, encoding="utf-8")


def table() -> tuple[str, list[str]]:
    """Return the table of budgets, and a sentence for each that is exceeded."""
    stored, values = limits(), measured()
    rows = [("what", "limit", "now")]
    rows += [(what, f"{stored[key]:,}", f"{now:,}") for key, (what, now) in values.items()]
    text = "\n".join(f"{what:<42} {limit:>8} {now:>8}" for what, limit, now in rows)
    # The tests count themselves while they run (tests/test_lint.py).
    over = [key for key, (_, now) in values.items() if now > stored[key] and key != "tests"]
    return text, [f"{key}: {values[key][1]:,}, the limit is {stored[key]:,}" for key in over]
