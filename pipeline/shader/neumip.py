"""`neumip` as a shader: the texture and the networks of one fabric."""

from collections.abc import Collection
from typing import Final

import numpy as np

from pipeline.models.networks.layers import LinearLayer, layers_of
from pipeline.models.networks.texture import DEPTH_SCALE, LAYERS, STEEPEST, texels_of
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.shader import descriptor
from pipeline.shader.network import Packed, add_layers, coloured_weights, network_shader, refuse_wishes
from pipeline.shader.tables import PlacedArrays
from weaves.fabric import Fabric

NEUMIP: Final = "neumip"


def neumip_shader(method: Neumip, fabric: Fabric, level: int | None, kinds: Collection[str]) -> descriptor.Shader:
    """Return the model for its fabric; BadInput if a level or kinds are wished, or its textures are too large."""
    refuse_wishes(method, level, kinds)
    weights = coloured_weights(fabric)
    return network_shader(NEUMIP, method, fabric, weights, _pack(method.network_of(fabric), weights))


def _pack(network: NeumipNetwork, weights: PlacedArrays) -> Packed:
    """Fill the buffer with layers and textures."""
    options, starts, described = network.options, {}, []
    for name, perceptron in (("offset", network.offset), ("decoder", network.decoder)):
        starts[f"{name.upper()}_LAYERS"] = weights.count
        if perceptron is not None:
            first, *others = layers_of(perceptron)
            # Rows of channels are filled up to whole elements, before those of directions.
            rows = np.insert(first.weights, [options.channels] * (-options.channels % 4), 0.0, axis=0)
            described += add_layers(weights, name, [LinearLayer(rows, first.biases), *others], "ReLU")
    starts["PYRAMID"] = weights.count
    for index, texture in enumerate(network.levels):
        weights.add(f"level {index}", texels_of(texture), "texels (rows, columns, channels); row 0 at the smallest v")
    starts["DEPTH"] = weights.count
    if network.depth is not None:
        weights.add("depth", texels_of(network.depth), "texels of the depth that shifts a place, at the finest level")
    channels = [f"feature {n}" for n in range(options.channels)]
    channels += ["0"] * (-len(channels) % 4)
    return Packed(
        {
            "CHANNEL_QUADS": -(-options.channels // 4),
            "HIDDEN_QUADS": -(-options.hidden // 4),
            "HIDDEN_LAYERS": LAYERS,
            "TEXELS_PER_YARN": options.texels_per_yarn,
            "LEVEL_COUNT": len(network.levels),
            "OFFSET": options.offset,
            **starts,
            "DEPTH_SCALE": DEPTH_SCALE,
            "STEEPEST": STEEPEST,
        },
        described,
        {
            "offset": [*channels, "wo.x", "wo.y", "0", "0"],
            "decoder": [*channels, "wi.x", "wi.y", "wo.x", "wo.y"],
        },
        {
            "offset": "depth d; the place moves by 0.1 d wo.xy / max(wo.z, 0.6) mean sides of the repeat",
            "decoder": f"(exp(x) - 1) / {options.log_k:g} of the specular ones, x of the diffuse; at least 0",
        },
    )
