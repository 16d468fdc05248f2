"""The code of a method from outside: find it, hash it, import it.

A file stands alone: it can import installed packages and no file beside it, so its hash covers its own code. A method
of several files, or with weights, is a package, of which every file is hashed.
"""

import hashlib
import importlib
import sys
from importlib.machinery import PathFinder
from importlib.metadata import packages_distributions, version
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, Final, NamedTuple

from pipeline.fingerprint import file_sha256
from weaves.errors import BadInput, WorkFailed, nearest

ADD: Final = "--add"
_MOST_BYTES: Final = 512 * 2**20  # of a package
_MOST_FILE: Final = 16 * 2**20  # bytes of a file of code
_OURS: Final = ("weaves", "pipeline", "reports", "jobs", "twillight")


class CodeSource(NamedTuple):
    """Code that was found."""

    place: str  # name of a module, or absolute path of a file
    name: str  # name of the class in it
    folder: str  # folder that holds the module; empty if it is installed, or a file
    root: Path  # the file, or the folder of the package

    @property
    def text(self) -> str:
        """``module:name``, or ``/path/of/file.py:name``."""
        return f"{self.place}:{self.name}"

    @property
    def is_file(self) -> bool:
        """True for a file that was named by its path, or is a module of the current folder."""
        return self.place.endswith(".py")

    def sha256(self) -> str:
        """Return the hash of the file, or of all files of the package and their names; BadInput if it is too large."""
        if self.root.is_file():
            if self.root.stat().st_size > _MOST_FILE:
                raise BadInput(ADD, "", self.text, f"the file {self.root.name} has more than {_MOST_FILE:,} bytes")
            return file_sha256(self.root)
        found, total = hashlib.sha256(), 0
        for path in sorted(self.root.rglob("*")):
            if not path.is_file() or "__pycache__" in path.parts:
                continue
            total += path.stat().st_size
            if total > _MOST_BYTES:
                raise BadInput(ADD, "", self.text, f"the package {self.root.name} has more than {_MOST_BYTES:,} bytes")
            found.update(f"{path.relative_to(self.root).as_posix()}\0{file_sha256(path)}\0".encode())
        return found.hexdigest()

    def distribution(self) -> str:
        """Return name and version of the distribution that installed it; empty if none did."""
        if self.is_file or self.folder:
            return ""
        names = packages_distributions().get(self.place.partition(".")[0])
        return f"{names[0]} {version(names[0])}" if names else ""

    def verify(self, sha256: str) -> None:
        """Raise WorkFailed unless the code has this hash."""
        if (found := self.sha256()) != sha256:
            there = f"its SHA-256 is {found[:12]}… on this machine, and {sha256[:12]}… was planned"
            raise WorkFailed(f"{self.text}: {there}; run the command again, with the same code on every worker")

    def of(self, module: ModuleType) -> Any:
        """Return what the name stands for in the imported module; BadInput if there is no such name."""
        if not hasattr(module, self.name):
            names = [name for name in vars(module) if not name.startswith("_")]
            raise BadInput(ADD, "", self.text, f"no such name; {nearest(self.name, names)}")
        return getattr(module, self.name)

    def imported(self) -> ModuleType:
        """Import the module or file."""
        if not self.is_file:
            if self.folder and self.folder not in sys.path:
                sys.path.append(self.folder)  # behind all others: no file there hides an installed package
            return importlib.import_module(self.place)
        module = ModuleType(f"added_{self.root.stem}")
        module.__file__ = str(self.root)
        sys.modules[module.__name__] = module  # dataclasses and pickle look it up there
        exec(compile(self.root.read_bytes(), str(self.root), "exec"), vars(module))
        return module


def locate(text: str, folder: str = "") -> CodeSource:
    """Find code by ``module:name`` or ``file.py:name``, as the command line has it.

    A path is relative to the current folder; so are modules that are not installed, if no other `folder` is given.
    BadInput if `text` has another form, or there is no such file or module.
    """
    place, _, name = text.rpartition(":")
    if not place or not name.isidentifier():
        raise BadInput(ADD, "", text, "must be MODULE:NAME, FILE.py:NAME, or the name of an installed method")
    if place.endswith(".py"):
        path = Path(place).resolve()
        if not path.is_file():
            raise BadInput(ADD, "", text, f"there is no file {place}")
        return CodeSource(str(path), name, "", path)
    parts = place.split(".")
    if not all(part.isidentifier() for part in parts):
        raise BadInput(ADD, "", text, f"{place} is no name of a module; a file needs its path, ending in .py")
    if parts[0] in _OURS:
        raise BadInput(ADD, "", text, "is part of this package; name it in the recipe")
    here = ""
    spec = find_spec(parts[0])
    if spec is None:
        here = str(Path(folder or ".").resolve())
        spec = PathFinder.find_spec(parts[0], [here])
    if spec is None:
        raise BadInput(ADD, "", text, f"there is no module {parts[0]}, installed or in the folder {here}")
    if locations := list(spec.submodule_search_locations or ()):
        return CodeSource(place, name, here, Path(locations[0]))
    root = Path(spec.origin or "")
    if not root.is_file():
        raise BadInput(ADD, "", text, f"{parts[0]} is part of Python")
    return CodeSource(str(root), name, "", root) if here else CodeSource(place, name, "", root)
