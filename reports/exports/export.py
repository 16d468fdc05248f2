"""One function that writes a fabric for other programs, and the table of the kinds of files that it knows."""

from importlib import import_module
from inspect import signature
from pathlib import Path
from typing import Any, Final

from pipeline.atomic import atomic_write
from weaves.draft_files.write import wif_text
from weaves.errors import BadInput
from weaves.fabric import Fabric

EXPORTS: Final = {
    "bsdf": ("reports.exports.bsdf:write_bsdf", ".xml"),
    "mesh": ("reports.exports.mesh:write_mesh", ".ply"),
    "wif": ("reports.exports.export:write_draft", ".wif"),
    "osl": ("reports.exports.osl:write_osl", ".osl"),
    "maps": ("reports.exports.maps:write_maps", ""),
    "shader": ("pipeline.shader.export_shader:write_shader", ""),
    "viewer": ("reports.viewer.view:write_page", ".html"),
}
"""The function that writes each kind, as MODULE:NAME, and how its path ends; a folder if it ends in nothing.

The function takes fabric, path and its own options, each with a default, and returns a sentence on what it wrote.
"""


def export(fabric: Fabric, kind: str, path: Path, /, **options: Any) -> str:
    """Write a fabric as one of `EXPORTS` to a file or folder, and return a sentence on what was written.

    Options that are left out have the defaults of the kind. BadInput if an option, the path or the fabric cannot be
    used; `where` is ``export`` and `key` the option or the kind.
    """
    writer, suffix = EXPORTS[kind]
    module, name = writer.split(":")
    write = getattr(import_module(module), name)
    for option, value in options.items():
        if option not in signature(write).parameters:
            raise BadInput("export", option, value, f"is not for {kind}; leave it out")
    if suffix and path.suffix != suffix:
        raise BadInput("export", kind, str(path), f"a path that ends in {suffix} is needed")
    return str(write(fabric, path, **options))


def write_draft(fabric: Fabric, path: Path) -> str:
    """Write a fabric as a draft that weaving programs read, and return a sentence on it.

    BadInput if the fabric needs more ends or picks than a file may have.
    """
    atomic_write(path, wif_text(fabric).encode())
    content = "structure and colours" if fabric.yarns_per_cm is None else "structure, colours, spacing and thickness"
    left = "" if fabric.yarns_per_cm else "; no spacing and thickness, because the fabric has no yarns_per_cm"
    return f"{path}: {content}{left}; a draft file has no place for the optics of yarns"
