"""`neumip` and `curved` as shaders: the textures and the perceptrons of one fabric."""

from collections.abc import Collection
from typing import Final

import numpy as np

from pipeline.models.curved.model import SHARPEST, Curved, CurvedNetwork
from pipeline.models.networks.layers import LinearLayer, layers_of
from pipeline.models.networks.texture import DEPTH_SCALE, LAYERS, STEEPEST, texels_of
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.shader import descriptor
from pipeline.shader.network import Packed, add_layers, coloured_weights, network_shader, refuse_wishes
from pipeline.shader.tables import PlacedArrays
from weaves.fabric import Fabric

NEUMIP: Final = "neumip"
CURVED_MODEL: Final = "curved"


def texture_shader(
    method: Neumip | Curved, fabric: Fabric, level: int | None, kinds: Collection[str]
) -> descriptor.Shader:
    """Return the model for its fabric; BadInput if a level or kinds are wished, or its textures are too large."""
    refuse_wishes(method, level, kinds)
    weights, network = coloured_weights(fabric), method.network_of(fabric)
    name = CURVED_MODEL if isinstance(network, CurvedNetwork) else NEUMIP
    return network_shader(name, method, fabric, weights, _pack(network, weights))


def _pack(network: NeumipNetwork | CurvedNetwork, weights: PlacedArrays) -> Packed:
    """Fill the buffer with layers and textures."""
    options, starts, described = network.options, {}, []
    seen, light, own = ["wo.x", "wo.y"], ["wi.x", "wi.y"], {}
    curved = isinstance(network, CurvedNetwork)
    perceptrons = {"offset": network.offset, "decoder": network.decoder}
    if isinstance(network, CurvedNetwork):
        perceptrons["opacity"] = network.opacity
        own = _silhouette(network)
        axes = "xyz"[: int(own["AXES"])]
        seen = [*(f"wo.{axis}" for axis in axes), "root of the curvature" if own["ROOT"] else "curvature"]
        seen += ["how deep the ray dips"] if own["TOUCH"] else []
        light = [f"wi.{axis}" for axis in axes]
    quads = -(-options.channels // 4), 2 if curved else 1
    inputs = {"offset": seen, "opacity": seen, "decoder": [*seen, *light] if curved else [*light, *seen]}
    channels = [f"feature {n}" for n in range(options.channels)]
    channels += ["0"] * (4 * quads[0] - len(channels))
    for name, perceptron in perceptrons.items():
        inputs[name] = [*channels, *inputs[name], *["0"] * (4 * quads[1] - len(inputs[name]))]
        starts[f"{name.upper()}_LAYERS"] = weights.count
        if perceptron is not None:
            first, *others = layers_of(perceptron)
            rows = np.zeros((4 * sum(quads), first.weights.shape[1]), np.float32)
            rows[[place for place, what in enumerate(inputs[name]) if what != "0"]] = first.weights
            described += add_layers(weights, name, [LinearLayer(rows, first.biases), *others], "ReLU")
    pyramids = {"PYRAMID": list(network.levels)}
    if isinstance(network, CurvedNetwork):
        pyramids["SILHOUETTE"] = list(network.opacity_levels)
    for name, levels in pyramids.items():
        starts[name] = weights.count
        for index, texture in enumerate(levels):
            title = f"level {index}" if name == "PYRAMID" else f"silhouette {index}"
            weights.add(title, texels_of(texture), "texels (rows, columns, channels); row 0 at the smallest v")
    starts["DEPTH"] = weights.count
    if network.depth is not None:
        weights.add("depth", texels_of(network.depth), "texels of the depth that shifts a place, at the finest level")
    outputs = {
        "offset": "depth d; the place moves by 0.1 d wo.xy / max(wo.z, 0.6) mean sides of the repeat",
        "decoder": f"(exp(x) - 1) / {options.log_k:g} of the specular ones, x of the diffuse; at least 0",
        "opacity": "x of a sigmoid; or, with GRAZING, mean and width of the grazing cosine",
    }
    return Packed(
        ("textures.slang",),
        {
            "CHANNEL_QUADS": quads[0],
            "DIRECTION_QUADS": quads[1],
            "HIDDEN_QUADS": -(-options.hidden // 4),
            "HIDDEN_LAYERS": LAYERS,
            "TEXELS_PER_YARN": options.texels_per_yarn,
            "LEVEL_COUNT": len(network.levels),
            "OFFSET": options.offset,
            **starts,
            "DEPTH_SCALE": DEPTH_SCALE,
            "STEEPEST": STEEPEST,
            **own,
        },
        described,
        {name: inputs[name] for name in perceptrons},
        {name: outputs[name] for name in perceptrons},
        float(own.get("LARGEST_CURVATURE", 0.0)),
    )


def _silhouette(network: CurvedNetwork) -> dict[str, bool | int | float]:
    """Return the constants that `curved` has beside those of `neumip`."""
    options = network.options
    axes, touch = 3 if options.directions == "vector" else 2, options.curvature_input == "touch"
    return {
        "AXES": axes,
        "SEEN": axes + 1 + touch,
        "ROOT": options.curvature_input != "linear",
        "TOUCH": touch,
        "GRAZING": options.silhouette == "grazing",
        "SHARPEST": SHARPEST,
        "FALL": float(network.fall),
        "LARGEST_CURVATURE": float(options.largest_curvature),
        "SILHOUETTE_TEXELS": options.silhouette_texels_per_yarn,
        "SILHOUETTE_LEVELS": len(network.opacity_levels),
    }
