"""`neumip` as a shader: the texture and the networks of one fabric.

They fill one buffer, `weights`, in elements of four numbers. A layer has its biases first, then its weights row after
row, one row an input. Rows are filled up with zeros to whole elements, and inputs to a multiple of four, so that the
shader multiplies vectors.
"""

from collections.abc import Collection, Sequence
from functools import partial
from typing import Final

import numpy as np

from pipeline.models.domain import Domain
from pipeline.models.networks.layers import LinearLayer, layers_of
from pipeline.models.networks.texture import DEPTH_SCALE, LAYERS, STEEPEST, texels_of
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.models.runtimes import as_onnx
from pipeline.scenes.shade import colours
from pipeline.shader import descriptor
from pipeline.shader.constants import TEXTURE_WIDTH, shared_constants
from pipeline.shader.golden import GROUPS, golden_of
from pipeline.shader.limits import MOST_HEIGHT
from pipeline.shader.tables import PlacedArrays, constants_slang, encoded
from weaves.errors import BadInput
from weaves.fabric import Fabric

NEUMIP: Final = "neumip"
NEUMIP_SOURCES: Final = ("arithmetic.slang", "query.slang", "colours.slang", "perceptron.slang", "neumip.slang")

MOST_ELEMENTS: Final = TEXTURE_WIDTH * MOST_HEIGHT
"""Most elements of the buffer: of a texture that every WebGL 2 allows."""


def _add_perceptron(buffer: PlacedArrays, network: str, layers: Sequence[LinearLayer]) -> list[descriptor.PlacedLayer]:
    """Append the layers of a network; inputs of the first one are filled up to whole elements."""
    described = []
    for index, layer in enumerate(layers):
        rows, name = np.pad(layer.weights, ((0, -len(layer.weights) % 4), (0, 0))), f"{network} {index}"
        biases = buffer.add(f"{name} biases", layer.biases, "biases")
        weights = buffer.add(f"{name} weights", rows, "weights (inputs, outputs)")
        activation = "none" if index == len(layers) - 1 else "ReLU"
        entry = descriptor.PlacedLayer(network=network, biases=biases, weights=weights, activation=activation)
        described.append(entry)
    return described


_NEUMIP_ONNX: Final = {
    "u": "centre along x as a share of the repeat, 0 to 1, (N,)",
    "v": "centre along y as a share of the repeat, (N,)",
    "sigma": "standard deviation of the round footprint, yarn spacings, (N,)",
    "wi": "unit vector to the light, (N, 3)",
    "wo": "unit vector to the viewer, (N, 3)",
}


def neumip_shader(method: Neumip, fabric: Fabric, level: int | None, kinds: Collection[str]) -> descriptor.Shader:
    """Return the model for its fabric; BadInput if a level or kinds are wished, or its textures are too large."""
    if kinds:
        raise BadInput("export", "kind", ", ".join(sorted(kinds)), f"{method.name} answers in front of flat cloth only")
    if level is not None:
        raise BadInput("export", "level", level, f"leave it out: {method.name} has no soft nodes")
    network, weights = method.network_of(fabric), PlacedArrays(channels=4)
    options = network.options
    weights.add("colours", colours(fabric).astype(np.float32), "k_s and k_d of warp and weft")
    constants, layers = _pack(network, weights)
    if weights.count > MOST_ELEMENTS:
        allowed = f"the shader takes at most {MOST_ELEMENTS:,} elements of weights"
        raise BadInput("export", "shader", f"{weights.count:,} elements", allowed)
    channels = [f"feature {n}" for n in range(options.channels)]
    channels += ["0"] * (-len(channels) % 4)
    trained_on, outside = _training(method.domain, fabric)
    ends, picks = fabric.thread_colours()
    files = {"float32": "tables/weights.f32", "float16": "tables/weights.f16"}
    buffer = descriptor.Buffer(files=files, channels=4, elements=weights.count, arrays=weights.places)
    described = descriptor.Descriptor(
        model=NEUMIP,
        fabric=fabric.name,
        outputs=descriptor.OUTPUTS | {"bounds": "the components: the network knows no bound of energy"},
        conventions=[*descriptor.CONVENTIONS, "An ellipse counts as the circle of its area, curved cloth as flat."],
        colours=descriptor.colours(fabric),
        repeat=fabric.weave.repeat,
        threads=(len(ends.diffuse), len(picks.diffuse)),
        limits={"elements": MOST_ELEMENTS},
        buffers={"weights": buffer},
        network=descriptor.Networks(
            name=method.name,
            trained_on=trained_on,
            outside=outside,
            inputs={
                "offset": [*channels, "wo.x", "wo.y", "0", "0"],
                "decoder": [*channels, "wi.x", "wi.y", "wo.x", "wo.y"],
            },
            outputs={
                "offset": "depth d; the place moves by 0.1 d wo.xy / max(wo.z, 0.6) mean sides of the repeat",
                "decoder": f"(exp(x) - 1) / {options.log_k:g} of the specular ones, x of the diffuse; at least 0",
            },
            layers=layers,
            onnx=_NEUMIP_ONNX,
        ),
    )
    return descriptor.Shader(
        NEUMIP_SOURCES,
        {
            "layout.slang": constants_slang(shared_constants(), "pipeline.analytic.soft_nodes"),
            "network.slang": constants_slang(constants, "pipeline.models.neumip"),
        },
        {path: encoded(np.concatenate(weights.parts), kind) for kind, path in files.items()},
        described,
        golden_of(
            {"front": GROUPS["front"]},
            fabric.weave.repeat,
            lambda queries: np.tile(method.predict(fabric, queries), 2),  # components are their own bounds
            lambda queries: np.tile(colours(fabric), (len(queries.u), 1, 1)),
            stretched=False,
        ),
        f"{weights.count:,} elements",
        False,
        partial(as_onnx, method, fabric, tuple(_NEUMIP_ONNX)),
    )


def _pack(
    network: NeumipNetwork, weights: PlacedArrays
) -> tuple[dict[str, bool | int | float], list[descriptor.PlacedLayer]]:
    """Fill the buffer; return the constants of the source, and what the descriptor says of the layers."""
    options, (ends, picks) = network.options, network.repeat
    starts, described = {}, []
    for name, perceptron in (("offset", network.offset), ("decoder", network.decoder)):
        starts[f"{name.upper()}_LAYERS"] = weights.count
        if perceptron is not None:
            first, *others = layers_of(perceptron)
            # Rows of channels are filled up to whole elements, before those of directions.
            rows = np.insert(first.weights, [options.channels] * (-options.channels % 4), 0.0, axis=0)
            described += _add_perceptron(weights, name, [LinearLayer(rows, first.biases), *others])
    starts["PYRAMID"] = weights.count
    for index, texture in enumerate(network.levels):
        weights.add(f"level {index}", texels_of(texture), "texels (rows, columns, channels); row 0 at the smallest v")
    starts["DEPTH"] = weights.count
    if network.depth is not None:
        weights.add("depth", texels_of(network.depth), "texels of the depth that shifts a place, at the finest level")
    constants: dict[str, bool | int | float] = {
        "COLOURS": weights.places["colours"].offset,
        "ENDS": ends,
        "PICKS": picks,
        "CHANNEL_QUADS": -(-options.channels // 4),
        "HIDDEN_QUADS": -(-options.hidden // 4),
        "HIDDEN_LAYERS": LAYERS,
        "TEXELS_PER_YARN": options.texels_per_yarn,
        "LEVEL_COUNT": len(network.levels),
        "OFFSET": options.offset,
        **starts,
        "DEPTH_SCALE": DEPTH_SCALE,
        "STEEPEST": STEEPEST,
        "LOG_K": float(options.log_k),
    }
    return constants, described


def _training(domain: Domain | None, fabric: Fabric) -> tuple[dict[str, tuple[float, float]], str]:
    """Return the ranges of a training, and what of a fabric lies outside, such as ``optical_thickness = 0.8``."""
    if domain is None:
        return {}, ""
    sigma, angles = domain.queries.sigma, (0.0, domain.queries.max_angle)
    ranges = {"footprint, yarn spacings": sigma, "angle to the normal, degrees": angles, **domain.yarns}
    try:
        domain.refuse_fabric(fabric, "")
    except BadInput as error:
        return ranges, f"{error.key} = {error.value}"
    return ranges, ""
