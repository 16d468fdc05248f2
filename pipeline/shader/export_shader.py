"""A folder with a model of a fabric for renderers: source, tables, descriptor and golden vectors."""

import json
from collections.abc import Collection, Sequence
from pathlib import Path

from pipeline.analytic.soft_nodes.groups import DETAILS
from pipeline.folders import own_files
from pipeline.models.curved.model import Curved
from pipeline.models.neumip.model import Neumip
from pipeline.models.registry import load_model, model_folder
from pipeline.models.runtimes import no_onnx
from pipeline.models.woven.model import Woven
from pipeline.shader.descriptor import GOLDEN, Shader, vectors
from pipeline.shader.languages import ALL, LANGUAGES, ONNX, SOURCE, compiler_for, refuse_unknown, translate
from pipeline.shader.soft_nodes import SOFT_NODES, soft_nodes_shader
from pipeline.shader.tables import wanted_kinds
from pipeline.shader.textures import CURVED_MODEL, NEUMIP, texture_shader
from pipeline.shader.woven import WOVEN, woven_shader
from weaves.errors import BadInput
from weaves.fabric import Fabric

_HOME = Path(__file__).parent


def write_shader(
    fabric: Fabric,
    folder: Path,
    model: str | None = None,
    level: int | None = None,
    language: Sequence[str] = (),
    kind: Sequence[str] = (),
) -> str:
    """Write a model of a fabric for renderers, whole or not at all, and return a sentence on the folder.

    An earlier export of the same model is replaced (`pipeline.folders`). `model` and `level` are as for `shader_of`.
    `language` names shading languages beside the source in Slang: keys of LANGUAGES, ONNX for the network alone, or
    ALL; `kind` kinds of queries beside light and viewer in front of flat cloth: of QUERY_KINDS, or EVERY. BadInput if a
    name is not known, a program or package is missing, there is no network for ONNX, or as `shader_of`; WorkFailed if
    slangc refuses the source.
    """
    refuse_unknown("language", language, (SOURCE, *LANGUAGES, ONNX, ALL))
    known = wanted_kinds(kind)
    wanted = [name for name in LANGUAGES if ALL in language or name in language]
    compiler = compiler_for(wanted) if wanted else None
    shader = shader_of(model, fabric, level, known)
    source, network = _source(shader), _network(shader, language)
    golden = json.dumps(vectors(shader.golden), separators=(",", ":")) + "\n"
    listing = f"{shader.about.model}.json"
    entries = ("evaluate", "draw", *(("scatter",) if shader.sampled else ()))
    with own_files(folder, listing) as here:
        for name, content in {**source, **shader.files, **network, GOLDEN: golden.encode()}.items():
            (here / name).parent.mkdir(exist_ok=True)
            (here / name).write_bytes(content)
        files = translate(wanted, compiler, here / SOURCE, here, entries) if compiler else {}
        if network:
            files[ONNX] = list(network)
        about = shader.about.model_copy(update={"source": list(source), "languages": files})
        (here / listing).write_text(about.model_dump_json(), encoding="utf-8")
        size = sum(path.stat().st_size for path in here.rglob("*") if path.is_file())
    outside = about.network.outside if about.network else ""
    warning = f"; {fabric.name} is not like its training: {outside}" if outside else ""
    return f"{folder}: {', '.join((SOURCE, *files, *sorted(known)))}; {shader.size}, {size / 1e3:,.0f} kB{warning}"


def _network(shader: Shader, languages: Sequence[str]) -> dict[str, bytes]:
    """Return the file of the network of a model as ONNX, if it is wished."""
    if ONNX not in languages and (ALL not in languages or shader.onnx is None):
        return {}
    if shader.onnx is None:
        raise BadInput("export", "language", ONNX, f"{shader.about.model} has no network; choose another model")
    if missing := no_onnx():
        raise BadInput("export", "language", ONNX, missing)
    return {f"{ONNX}/network.onnx": shader.onnx()}


def _source(shader: Shader) -> dict[str, bytes]:
    name, files = shader.about.model, (*shader.sources, "evaluate.slang", "draw.slang")
    texts = {file: (_HOME / file).read_text(encoding="utf-8") for file in files}
    threads = "/// Threads differ in colour.\n#define THREADS\n\n" if shader.threads else ""
    sampled = '#include "importance.slang"\n\n/// Directions can be drawn.\n#define SAMPLED\n' if shader.sampled else ""
    main = f'// The model of this folder.\n\n{threads}#include "{name}.slang"\n{sampled}\n'
    texts |= {**shader.generated, "model.slang": f"{main}Answer bsdf(Query query) {{ return {name}(query); }}\n"}
    return {f"{SOURCE}/{file}": text.encode() for file, text in texts.items()}


def shader_of(model: str | None, fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return a model of a fabric, ready to be written.

    `model` is `soft_nodes`, which is meant if it is left out, or the folder of a trained `neumip`, `curved` or `woven`;
    `level` the level of detail of the soft nodes; `kinds` are of QUERY_KINDS. BadInput if there is no such model, its
    files are damaged or of another version, it was not trained on the fabric, it has no shader, or has no such level or
    kinds.
    """
    if model is None or model == SOFT_NODES:
        return soft_nodes_shader(fabric, level, kinds)
    if model.partition(":")[0] == "selvage":
        levels = ", ".join(map(str, DETAILS))
        allowed = f"chooses a level for each query and has no shader: export {SOFT_NODES} at one --level of {levels}"
        raise BadInput("export", "model", model, allowed)
    (method,) = load_model(model_folder(model, "export", "model", [SOFT_NODES]))
    if not isinstance(method, Neumip | Curved | Woven):
        allowed = (
            f"has no shader; {SOFT_NODES} and the folders of a trained {NEUMIP}, {CURVED_MODEL} or {WOVEN} have one"
        )
        raise BadInput("export", "model", model, allowed)
    if not method.covers(fabric):
        raise BadInput("export", "model", model, f"this model was not trained on {fabric.name}")
    if isinstance(method, Woven):
        return woven_shader(method, fabric, level, kinds)
    return texture_shader(method, fabric, level, kinds)
