"""The sources, each read once, and parsed once when that is asked for."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("weaves", "pipeline", "reports", "jobs")

COMMENT = re.compile(r"(?:^ *|  )(# .*)$", re.M)
"""Comments as `ruff format` leaves them."""


@dataclass(frozen=True)
class Source:
    """One Python file; `module` is its dotted name from the root of the tree."""

    path: Path
    module: str
    text: str

    @classmethod
    def read(cls, path: Path) -> Source:
        text = path.read_text(encoding="utf-8")
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        return cls(path, module, text)

    @property
    def name(self) -> str:
        return str(self.path.relative_to(ROOT))

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> list[ast.AST]:
        return list(ast.walk(self.tree))

    @cached_property
    def strings(self) -> list[ast.Constant]:
        """Docstrings of modules, classes, functions and fields."""
        values = (node.value for node in self.nodes if isinstance(node, ast.Expr))
        return [value for value in values if isinstance(value, ast.Constant) and isinstance(value.value, str)]

    @cached_property
    def prose(self) -> list[str]:
        """Its docstrings and comments."""
        return [node.value for node in self.strings] + COMMENT.findall(self.text)

    @cached_property
    def imports(self) -> list[str]:
        """Every module or name that it imports, at its top or inside a function, as a dotted name."""
        names: list[str] = []
        for node in self.nodes:
            if isinstance(node, ast.Import):
                names += [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names += [f"{'.' * node.level}{node.module}.{alias.name}" for alias in node.names]
        return names

    @cached_property
    def lines_of_code(self) -> int:
        """Lines that are not blank, and no comment, docstring or import."""
        aside = [*self.strings, *(node for node in self.nodes if isinstance(node, (ast.Import, ast.ImportFrom)))]
        skipped = {n for node in aside for n in range(node.lineno, node.end_lineno + 1)}
        lines = enumerate(map(str.strip, self.text.splitlines()), 1)
        return sum(bool(line) and not line.startswith("#") and n not in skipped for n, line in lines)

    @cached_property
    def top(self) -> dict[str, ast.stmt]:
        """The names that its module binds, each with its statement."""
        return bound(self.tree.body)


def bound(body: list[ast.stmt]) -> dict[str, ast.stmt]:
    """Return the names that statements of a module or class bind, each with its statement."""
    names: dict[str, ast.stmt] = {}
    for node in body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            names[node.name] = node
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            names |= {(alias.asname or alias.name).split(".")[0]: node for alias in node.names}
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            names |= {name.id: node for name in ast.walk(node) if isinstance(name, ast.Name)}
        elif isinstance(node, (ast.If, ast.Try, ast.For, ast.With)):
            names |= bound(node.body)
    return names


def sources(*folders: str) -> Iterator[Source]:
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*.py")):
            yield Source.read(path)


DOORS = [Source.read(ROOT / name) for name in ("twillight.py", "twillight_mitsuba.py")]
"""Modules for users, which no other imports."""

MODULES = {source.module: source for source in sources(*PACKAGES)}

TESTS = list(sources("tests"))

ASIDE = list(sources("docs", "notebooks"))
"""Programs of the documents."""


def module_of(name: str) -> str:
    """Return the module that a dotted name is or is in; the name itself if it is of another package."""
    parts = name.split(".")
    return next((m for n in range(len(parts), 0, -1) if (m := ".".join(parts[:n])) in MODULES), name)


@cache
def graph() -> dict[str, set[str]]:
    """Return the modules that each one imports."""
    return {m: {module_of(name) for name in source.imports} & MODULES.keys() - {m} for m, source in MODULES.items()}


def reachable(starts: list[str]) -> set[str]:
    """Return the modules that these import, directly or not, and themselves."""
    reached: set[str] = set()
    left = list(starts)
    while left:
        if (module := left.pop()) not in reached:
            reached.add(module)
            left += graph()[module]
    return reached
