"""Shading languages: what slangc makes of the source, and where it is found."""

import re
import shutil
import subprocess
from collections.abc import Collection, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Final, NamedTuple

from weaves.errors import BadInput, WorkFailed, one_line

SOURCE: Final = "slang"
ONNX: Final = "onnx"  # the language of the source, and the network of a model alone: they need no compiler
ALL: Final = "all"  # every language


class Program(NamedTuple):
    """A file that slangc makes of a source, with its entry points."""

    file: str
    entries: tuple[str, ...]
    source: str = "evaluate.slang"
    stage: str = "compute"
    """``compute``, or ``fragment``: then it reads textures."""


class Language(NamedTuple):
    """A language: how slangc calls it, and the files written in it."""

    target: str
    programs: tuple[Program, ...]


_EVALUATE, _SCATTER, _DRAW = ("evaluate",), ("scatter",), ("draw",)  # entry points
_ES_PROGRAMS: Final = (
    Program("evaluate.frag", _EVALUATE, stage="fragment"), Program("draw.frag", _DRAW, "draw.slang", "fragment")
)  # fmt: skip

LANGUAGES: Final = {
    "cpp": Language("cpp", (Program("evaluate.cpp", _EVALUATE + _SCATTER),)),
    "cuda": Language("cuda", (Program("evaluate.cu", _EVALUATE + _SCATTER),)),
    "glsl": Language("glsl", (Program("evaluate.comp", _EVALUATE), Program("scatter.comp", _SCATTER))),
    "glsles": Language("glsl", _ES_PROGRAMS),
    # slangc writes a file of HLSL for each entry point.
    "hlsl": Language("hlsl", (Program("evaluate.hlsl", _EVALUATE), Program("scatter.hlsl", _SCATTER))),
    "metal": Language("metal", (Program("evaluate.metal", _EVALUATE + _SCATTER),)),
    "wgsl": Language("wgsl", (Program("evaluate.wgsl", _EVALUATE + _SCATTER),)),
}
"""Languages that slangc makes, by name."""

_PRECISE = ("float", "int", "sampler2D", "isampler2D", "usampler2D")
_ES: Final = (
    (r"#version 450\n", "#version 300 es\n" + "".join(f"precision highp {kind};\n" for kind in _PRECISE)),
    (r"layout\(row_major\) (?:uniform|buffer);\n", ""),
    (r"layout\(binding = \d+\)\n", ""),
)
"""Replacements that make GLSL ES 3.00 of GLSL 4.50 without storage buffers: version and precision; the layout of
matrices, of which there are none; bindings, which a program sets by name."""


def refuse_unknown(key: str, names: Collection[str], known: Collection[str]) -> None:
    """Refuse a name of an option that is not known."""
    for name in names:
        if name not in known:
            raise BadInput("export", key, one_line(name, 40), f"must be one of {', '.join(known)}")


def slangc() -> Path | None:
    """Return the compiler: that of the package slangtorch, else the one on the search path; None if there is none."""
    spec = find_spec("slangtorch")
    if spec is not None and spec.origin is not None:
        for name in ("slangc", "slangc.exe"):
            if (own := Path(spec.origin).parent / "bin" / name).is_file():
                return own
    return Path(program) if (program := shutil.which("slangc")) else None


def compiler_for(languages: Sequence[str]) -> Path:
    """Return slangc; BadInput, naming the languages that need it, if it is not there."""
    compiler = slangc()
    if compiler is None:
        allowed = f"slangc is needed: pip install --no-deps slangtorch; {SOURCE} is written without it"
        raise BadInput("export", "language", ", ".join(languages), allowed)
    return compiler


def translate(
    languages: Sequence[str], compiler: Path, source: Path, folder: Path, entries: Collection[str]
) -> dict[str, list[str]]:
    """Write programs in a folder for each language; return their paths, WorkFailed if slangc refuses the source."""
    written: dict[str, list[str]] = {}
    for name in languages:
        (folder / name).mkdir()
        target, programs = LANGUAGES[name]
        for program in programs:
            present = program._replace(entries=tuple(entry for entry in program.entries if entry in entries))
            if present.entries:
                compile_program(compiler, source, present, target, folder / name / program.file)
                written.setdefault(name, []).append(f"{name}/{program.file}")
    return written


def compile_program(compiler: Path, source: Path, program: Program, target: str, path: Path) -> None:
    """Write one program; what is to draw in a browser becomes GLSL ES 3.00. WorkFailed if slangc refuses it."""
    textures = program.stage == "fragment"
    options = ["-line-directive-mode", "none", *(["-DTEXTURES"] if textures else [])]
    for entry in program.entries:
        options += ["-entry", entry, "-stage", program.stage]
    command = [str(compiler), str(source / program.source), *options, "-target", target, "-o", str(path)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=300.0, check=False)
    except (OSError, subprocess.SubprocessError) as error:
        raise WorkFailed(f"{compiler}: {one_line(str(error), 200)}") from error
    if done.returncode != 0:
        raise WorkFailed(f"{compiler}: {one_line(done.stderr or done.stdout, 300)}")
    text = path.read_text(encoding="utf-8")
    for pattern, other in _ES if textures else ():
        text = re.sub(pattern, other, text)
    path.write_text(_dense(text), encoding="utf-8")


def _dense(text: str) -> str:
    """Return a program without indentation, comments on lines of their own and empty lines: a fifth shorter."""
    without = re.sub(r"^[ \t]+|[ \t]+$|/\*.*?\*/", "", text, flags=re.M | re.S)
    return re.sub(r"^(?://.*)?\n", "", without, flags=re.M)
