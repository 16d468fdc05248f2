"""The folder that `twillight export --shader` writes: source, tables, descriptor and golden vectors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from pipeline.folders import own_files
from pipeline.models.runtimes import no_onnx
from pipeline.shader.descriptor import GOLDEN, vectors
from pipeline.shader.languages import ALL, ONNX, SOURCE, compiler_for, made, refuse_unknown, translate
from pipeline.shader.models import shader_of
from pipeline.shader.shader import Shader
from pipeline.shader.sides import wanted_kinds
from weaves.errors import BadInput
from weaves.fabric import Fabric

ENTRIES: Final = ("evaluate.slang", "draw.slang")
"""Files of the source with entry points, the same for all models."""

_HOME = Path(__file__).parent


def export_shader(
    fabric: Fabric,
    folder: Path,
    level: int | None,
    languages: Sequence[str],
    kinds: Sequence[str] = (),
    model: str | None = None,
) -> str:
    """Write a model of a fabric for renderers, whole or not at all, and return a sentence on the folder.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    folder : Path
        Folder to write; an earlier export of the same model is replaced (`pipeline.folders`).
    level : int, optional
        Level of detail k of the soft nodes, one of DETAILS.
    languages : sequence of str
        Shading languages beside the source in Slang: keys of LANGUAGES, ONNX for the network alone, or ALL.
    kinds : sequence of str
        Kinds of queries beside light and viewer in front of flat cloth: of KINDS, or EVERY.
    model : str, optional
        The model (`shader_of`); the soft nodes if left out.

    Raises
    ------
    BadInput
        If a language or kind is not known, slangc or a package is needed and not there, the model has no network for
        ONNX, or as `shader_of`.
    WorkFailed
        If slangc refuses the source.
    """
    refuse_unknown(languages)
    known = wanted_kinds(kinds)
    wanted = made(languages)
    compiler = compiler_for(wanted) if wanted else None
    shader = shader_of(model, fabric, level, known)
    onnx = _onnx(shader, languages)
    listing = f"{shader.name}.json"
    entries = ("evaluate", "draw", *(("scatter",) if shader.sampled else ()))
    with own_files(folder, listing) as here:
        source = here / SOURCE
        source.mkdir()
        names = _write_source(shader, source)
        files = translate(wanted, compiler, source, here, entries) if compiler else {}
        contents = shader.files | ({} if onnx is None else {f"{ONNX}/network.onnx": onnx})
        for name, content in contents.items():
            (here / name).parent.mkdir(exist_ok=True)
            (here / name).write_bytes(content)
        if onnx is not None:
            files[ONNX] = [f"{ONNX}/network.onnx"]
        (here / GOLDEN).write_text(vectors(shader.golden).model_dump_json() + "\n", encoding="utf-8")
        said = shader.said.model_copy(update={"source": names, "languages": files})
        (here / listing).write_text(said.model_dump_json(indent=1) + "\n", encoding="utf-8")
        size = sum(path.stat().st_size for path in here.rglob("*") if path.is_file())
    outside = said.network.outside if said.network else ""
    warning = f"; {fabric.name} is not like its training: {outside}" if outside else ""
    return f"{folder}: {', '.join((SOURCE, *files, *sorted(known)))}; {shader.size}, {size / 1e3:,.0f} kB{warning}"


def _onnx(shader: Shader, languages: Sequence[str]) -> bytes | None:
    """Return the network of a model as ONNX, if it is wished."""
    if ONNX not in languages and (ALL not in languages or shader.onnx is None):
        return None
    if shader.onnx is None:
        raise BadInput("export", "--language", ONNX, f"{shader.name} has no network; choose another --model")
    if missing := no_onnx():
        raise BadInput("export", "--language", ONNX, missing)
    return shader.onnx()


def _write_source(shader: Shader, folder: Path) -> list[str]:
    """Write the source, and return its files."""
    texts = {name: (_HOME / name).read_text(encoding="utf-8") for name in (*shader.sources, *ENTRIES)}
    name = shader.name
    lines = ["// The model of this folder.", "", f'#include "{name}.slang"']
    if shader.sampled:
        lines += ['#include "importance.slang"', "", "/// Directions can be drawn.", "#define SAMPLED"]
    lines += ["", f"Answer bsdf(Query query) {{ return {name}(query); }}", ""]
    texts |= {**shader.generated, "model.slang": "\n".join(lines)}
    for file, text in texts.items():
        (folder / file).write_text(text, encoding="utf-8")
    return [f"{SOURCE}/{file}" for file in texts]
