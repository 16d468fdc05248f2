"""The MaterialX document: an OpenPBR surface whose inputs are the maps of the folder [Andersson2024OpenPBR].

geometry_tangent        cross product of normal and fibre direction: OpenPBR's tangent is the rougher direction
subsurface              of a thin-walled surface with a scatter anisotropy of 1, all of which goes through; its weight
is the material's `transmitted`, and the base colour is divided by what is left
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, Final

from pipeline.materials.lobes import SHEEN_ROUGHNESS
from pipeline.materials.textures import Constants

FILE: Final = "material.mtlx"

LINEAR: Final = "lin_rec709"
"""Colour space of the EXR files."""


def write_openpbr(path: Path, name: str, material: Constants) -> None:
    """Write the document.

    Parameters
    ----------
    path : Path
        File to write, in the folder of the maps.
    name : str
        Name of the fabric.
    material : Constants
        Numbers that hold for all texels.
    """
    import MaterialX

    document = MaterialX.createDocument()
    document.setDataLibrary(_library())
    document.setColorSpace(LINEAR)
    identifier = MaterialX.createValidName(name)
    shader = document.addNode("open_pbr_surface", f"{identifier}_surface", "surfaceshader")

    def connect(key: str, kind: str, node: Any) -> None:
        shader.addInput(key, kind).setConnectedNode(node)

    def value(key: str, number: Any, kind: str) -> None:
        shader.setInputValue(key, number, kind)

    base = _image(document, "base_color", "color3")
    if material.transmitted > 0.0:
        left = document.addNode("divide", "base_left", "color3")
        left.addInput("in1", "color3").setConnectedNode(base)
        left.setInputValue("in2", max(1.0 - material.transmitted, 1e-3), "float")
        base = left
        value("geometry_thin_walled", True, "boolean")
        value("subsurface_weight", material.transmitted, "float")
        value("subsurface_scatter_anisotropy", 1.0, "float")
        through = document.addNode("divide", "transmission_left", "color3")
        through.addInput("in1", "color3").setConnectedNode(_image(document, "transmission_color", "color3"))
        through.setInputValue("in2", max(material.transmitted, 1e-3), "float")
        connect("subsurface_color", "color3", through)
    connect("base_color", "color3", base)
    connect("specular_color", "color3", _image(document, "specular_color", "color3"))
    connect("specular_roughness", "float", _image(document, "roughness", "float"))
    connect("specular_roughness_anisotropy", "float", _image(document, "anisotropy", "float"))
    value("specular_ior", material.ior, "float")
    if material.open_cloth:
        connect("geometry_opacity", "float", _image(document, "opacity", "float"))
    normal, fibre = (_in_world(document, name) for name in ("normal_opengl", "tangent"))
    across = document.addNode("crossproduct", "across", "vector3")
    across.addInput("in1", "vector3").setConnectedNode(normal)
    across.addInput("in2", "vector3").setConnectedNode(fibre)
    connect("geometry_normal", "vector3", normal)
    connect("geometry_tangent", "vector3", across)
    if (weight := float(material.sheen.max())) > 0.0:
        value("fuzz_weight", weight, "float")
        value("fuzz_color", MaterialX.Color3(*(material.sheen / weight).tolist()), "color3")
        value("fuzz_roughness", SHEEN_ROUGHNESS, "float")
    document.addMaterialNode(identifier, shader)
    valid, reason = document.validate()
    if not valid:
        raise ValueError(f"MaterialX refuses the document: {reason}")
    MaterialX.writeToXmlFile(document, str(path))


def _image(document: Any, name: str, kind: str) -> Any:
    """Add the node that reads a map."""
    node = document.addNode("tiledimage", name, kind)
    node.addInput("file", "filename").setValueString(f"{name}.exr")
    if kind != "color3":
        node.getInput("file").setColorSpace("none")
    return node


def _in_world(document: Any, name: str) -> Any:
    """Add the nodes that read a map of directions and turn them into the world's."""
    node = document.addNode("normalmap", f"{name}_world", "vector3")
    node.addInput("in", "vector3").setConnectedNode(_image(document, name, "vector3"))
    return node


@cache
def _library() -> Any:
    """Return MaterialX's own definitions of nodes."""
    import MaterialX

    library = MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath(), library)
    return library
