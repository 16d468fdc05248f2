"""Materials made of the maps of a folder: a MaterialX document, and a draped sample of the cloth as GLB.

The document is an OpenPBR surface of version `OPENPBR` [Andersson2024OpenPBR] whose inputs are the maps. Its
`geometry_tangent` is the cross product of normal and fibre direction, because OpenPBR's tangent is the rougher
direction. Light that goes through is the subsurface of a thin-walled surface with a scatter anisotropy of 1; its
weight is the material's `transmitted`, and the base colour is divided by what is left.

The sample has the shape of the scene `drape`, in metres, y up: base colour with opacity, metallic-roughness, normal,
and the extensions of glTF 2.0 [Khronos2021GLTF] KHR_materials_anisotropy, KHR_materials_specular (coloured),
KHR_materials_ior and KHR_materials_sheen. Gaps are transparent by `alphaMode`. Light that goes diffusely through yarns
has no ratified extension and is left out.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from pipeline.compiled.arrays import Float64
from pipeline.materials.lobes import SHEEN_ROUGHNESS
from pipeline.materials.planes import Layout
from pipeline.materials.textures import Constants, Textures, across_direction, gltf_strength
from pipeline.scenes.shipped import DRAPE_YARNS, drape_surface, grid_faces
from reports.images.texture import png_bytes
from weaves.fabric import Fabric

DOCUMENT: Final = "material.mtlx"
SAMPLE: Final = "sample.glb"

OPENPBR: Final = "1.1.2"
"""Version of OpenPBR for which a document is made; 1.1.1 in MaterialX up to 1.39.5 squares `subsurface_color`."""

DEFAULT_YARNS_PER_CM: Final = (20.0, 20.0)  # ends and picks per centimetre of a fabric that does not state them

LINEAR: Final = "lin_rec709"  # colour space of the EXR files

LARGEST_TEXTURE: Final = 1024  # longest side of the textures in the file


def yarns_per_cm(fabric: Fabric) -> tuple[float, float]:
    """Return ends and picks per centimetre of a fabric, `DEFAULT_YARNS_PER_CM` if it does not state them."""
    return fabric.yarns_per_cm or DEFAULT_YARNS_PER_CM


def spacing_cm(fabric: Fabric) -> float:
    """Return the geometric mean of the yarn spacings."""
    ends, picks = yarns_per_cm(fabric)
    return float((ends * picks) ** -0.5)


def write_openpbr(path: Path, name: str, material: Constants) -> None:
    """Write the MaterialX document into the folder of the maps."""
    import MaterialX

    document = MaterialX.createDocument()
    document.setDataLibrary(_library())
    document.setColorSpace(LINEAR)
    identifier = MaterialX.createValidName(name)
    shader = document.addNode("open_pbr_surface", f"{identifier}_surface", "surfaceshader")

    base = _image(document, "base_color", "color3")
    if material.transmitted > 0.0:
        base = _divided(document.addNode("divide", "base_left", "color3"), base, 1.0 - material.transmitted)
        shader.setInputValue("geometry_thin_walled", True, "boolean")
        shader.setInputValue("subsurface_weight", material.transmitted, "float")
        shader.setInputValue("subsurface_scatter_anisotropy", 1.0, "float")
        left = document.addNode("divide", "transmission_left", "color3")
        through = _image(document, "transmission_color", "color3")
        _connect(shader, "subsurface_color", _divided(left, through, material.transmitted))
    _connect(shader, "base_color", base)
    _connect(shader, "specular_color", _image(document, "specular_color", "color3"))
    _connect(shader, "specular_roughness", _image(document, "roughness", "float"))
    _connect(shader, "specular_roughness_anisotropy", _image(document, "anisotropy", "float"))
    shader.setInputValue("specular_ior", material.ior, "float")
    if material.open_cloth:
        _connect(shader, "geometry_opacity", _image(document, "opacity", "float"))
    normal, fibre = (_in_world(document, name) for name in ("normal_opengl", "tangent"))
    across = document.addNode("crossproduct", "across", "vector3")
    _connect(across, "in1", normal)
    _connect(across, "in2", fibre)
    _connect(shader, "geometry_normal", normal)
    _connect(shader, "geometry_tangent", across)
    if (weight := float(material.sheen.max())) > 0.0:
        shader.setInputValue("fuzz_weight", weight, "float")
        shader.setInputValue("fuzz_color", MaterialX.Color3(*(material.sheen / weight).tolist()), "color3")
        shader.setInputValue("fuzz_roughness", SHEEN_ROUGHNESS, "float")
    document.addMaterialNode(identifier, shader)
    valid, reason = document.validate()
    if not valid:
        raise ValueError(f"MaterialX refuses the document: {reason}")
    MaterialX.writeToXmlFile(document, str(path))


def _connect(node: Any, key: str, source: Any) -> None:
    """Make the output of a node an input of another."""
    node.addInput(key, source.getType()).setConnectedNode(source)


def _divided(node: Any, colour: Any, number: float) -> Any:
    """Return a node of division, which gets a colour and a number of at least 1e-3."""
    _connect(node, "in1", colour)
    node.setInputValue("in2", max(number, 1e-3), "float")
    return node


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
    _connect(node, "in", _image(document, name, "vector3"))
    return node


@cache
def _library() -> Any:
    """Return MaterialX's own definitions of nodes."""
    import MaterialX

    library = MaterialX.createDocument()
    MaterialX.loadLibraries(MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath(), library)
    return library


def write_sample(path: Path, fabric: Fabric, shown: Layout, level: Textures, material: Constants) -> None:
    """Write the sample as GLB, with the maps of one level embedded."""
    import pygltflib as gltf

    file = _File(gltf)
    vertices, faces = _draped(fabric, shown)
    indices = {
        name: file.array(values.astype(np.float32), f"VEC{values.shape[1]}", gltf.FLOAT, gltf.ARRAY_BUFFER)
        for name, values in vertices.items()
    }
    corners = file.array(faces.reshape(-1, 1), gltf.SCALAR, gltf.UNSIGNED_INT, gltf.ELEMENT_ARRAY_BUFFER)
    primitive = gltf.Primitive(attributes=gltf.Attributes(**indices), indices=corners, material=0)
    document = file.document
    document.meshes.append(gltf.Mesh(name=fabric.name, primitives=[primitive]))
    document.nodes.append(gltf.Node(name=fabric.name, mesh=0))
    document.scenes.append(gltf.Scene(nodes=[0]))
    document.scene = 0
    document.materials.append(_material(gltf, file, fabric.name, level, material))
    document.asset = gltf.Asset(version="2.0", generator="twillight")
    document.buffers.append(gltf.Buffer(byteLength=len(file.content)))
    document.set_binary_blob(file.content)
    document.save_binary(str(path))


def _material(gltf: Any, file: _File, name: str, level: Textures, material: Constants) -> Any:
    """Return the material of the sample; its textures are added to the file."""
    ones = np.ones_like(level.opacity)
    surface = np.stack([ones, np.sqrt(level.alpha_along), 0.0 * ones], axis=-1)
    strength = gltf_strength(level.alpha_along, level.alpha_across)
    direction = 0.5 + 0.5 * across_direction(level.normal, level.tangent)
    colour = np.concatenate([level.base_color, level.opacity[..., None]], axis=-1)
    base = file.texture("base_color", png_bytes(colour if material.open_cloth else level.base_color, "colour"))
    specular = file.texture("specular_color", png_bytes(level.specular_color, "colour"))
    turned = file.texture("anisotropy", png_bytes(np.concatenate([direction, strength[..., None]], axis=-1), "share"))
    extensions: dict[str, Any] = {
        "KHR_materials_anisotropy": {"anisotropyStrength": 1.0, "anisotropyTexture": {"index": turned}},
        "KHR_materials_specular": {"specularFactor": 1.0, "specularColorTexture": {"index": specular}},
        "KHR_materials_ior": {"ior": material.ior},
        "KHR_materials_sheen": {"sheenColorFactor": material.sheen.tolist(), "sheenRoughnessFactor": SHEEN_ROUGHNESS},
    }
    file.document.extensionsUsed = sorted(extensions)
    return gltf.Material(
        name=name,
        doubleSided=True,
        alphaMode=gltf.BLEND if material.open_cloth else gltf.OPAQUE,
        alphaCutoff=None,
        pbrMetallicRoughness=gltf.PbrMetallicRoughness(
            baseColorTexture=gltf.TextureInfo(index=base),
            metallicRoughnessTexture=gltf.TextureInfo(index=file.texture("roughness", png_bytes(surface, "share"))),
            metallicFactor=0.0,
            roughnessFactor=1.0,
        ),
        normalTexture=gltf.NormalMaterialTexture(
            index=file.texture("normal", png_bytes(0.5 + 0.5 * level.normal, "direction"))
        ),
        extensions=extensions,
    )


class _File:
    """A glTF document with one buffer, filled part by part."""

    def __init__(self, gltf: Any) -> None:
        self.gltf = gltf
        self.document = gltf.GLTF2()
        linear, repeat = gltf.LINEAR_MIPMAP_LINEAR, gltf.REPEAT
        self.document.samplers.append(gltf.Sampler(magFilter=gltf.LINEAR, minFilter=linear, wrapS=repeat, wrapT=repeat))
        self.content = b""

    def array(self, values: npt.NDArray[Any], kind: str, component: int, target: int) -> int:
        """Add an array (N, n), and return its index."""
        accessor = self.gltf.Accessor(
            bufferView=self._view(values.tobytes(), target), componentType=component, count=len(values), type=kind,
            min=values.min(axis=0).tolist(), max=values.max(axis=0).tolist(),
        )  # fmt: skip
        self.document.accessors.append(accessor)
        return len(self.document.accessors) - 1

    def texture(self, name: str, png: bytes) -> int:
        """Add a picture as a texture, and return its index."""
        view = self._view(png, None)
        self.document.images.append(self.gltf.Image(name=name, bufferView=view, mimeType=self.gltf.IMAGEPNG))
        self.document.textures.append(self.gltf.Texture(sampler=0, source=len(self.document.images) - 1))
        return len(self.document.textures) - 1

    def _view(self, content: bytes, target: int | None) -> int:
        start = len(self.content)
        view = self.gltf.BufferView(buffer=0, byteOffset=start, byteLength=len(content), target=target)
        self.document.bufferViews.append(view)
        self.content += content + bytes(-len(content) % 4)  # parts begin at multiples of four bytes
        return len(self.document.bufferViews) - 1


def _draped(fabric: Fabric, shown: Layout) -> tuple[dict[str, Float64], npt.NDArray[np.uint32]]:
    """Return the mesh of the scene `drape`, in the size in which the cloth's yarns have their spacing.

    Attributes of its vertices by name, in metres, y up, with unit normals and tangents; and its triangles.
    """
    points, normals, lengths = drape_surface()
    metres = DRAPE_YARNS * spacing_cm(fabric) / 100.0
    per_cm = np.array(yarns_per_cm(fabric))
    # Texture coordinates count maps; those of glTF run downwards.
    uv = lengths * metres * 100.0 * per_cm / (shown.ends, shown.picks)
    tangents = _tangents(points, normals, uv)
    tangents = np.concatenate([_upright(tangents[..., :3].reshape(-1, 3)), tangents[..., 3:].reshape(-1, 1)], axis=-1)
    return {
        "POSITION": _upright(points.reshape(-1, 3)) * metres,
        "NORMAL": _upright(normals.reshape(-1, 3)),
        "TANGENT": tangents,
        "TEXCOORD_0": (uv * (1.0, -1.0) + (0.0, 1.0)).reshape(-1, 2),
    }, grid_faces(*points.shape[:2])


def _tangents(points: Float64, normals: Float64, uv: Float64) -> Float64:
    """Return the unit direction of growing u at every vertex, and 1 where growing v is at its left, else -1."""
    p_row, p_column, t_row, t_column = (np.asarray(np.gradient(v, axis=a)) for v in (points, uv) for a in (0, 1))
    determinant = t_column[..., 0] * t_row[..., 1] - t_row[..., 0] * t_column[..., 1]
    along_u = (p_column * t_row[..., 1:] - p_row * t_column[..., 1:]) / determinant[..., None]
    along_v = (p_row * t_column[..., :1] - p_column * t_row[..., :1]) / determinant[..., None]
    along_u = along_u - normals * (along_u * normals).sum(axis=-1, keepdims=True)
    along_u /= np.linalg.norm(along_u, axis=-1, keepdims=True)
    left = (np.cross(normals, along_u) * along_v).sum(axis=-1, keepdims=True)
    return np.concatenate([along_u, np.where(left < 0.0, -1.0, 1.0)], axis=-1)


def _upright(vectors: Float64) -> Float64:
    """Turn vectors from z up to y up."""
    return np.stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]], axis=-1)
