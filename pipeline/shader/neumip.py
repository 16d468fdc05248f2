"""`neumip` as a shader: the textures and perceptrons of one fabric."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.models.networks import perceptron as linear
from pipeline.models.networks.texture import DEPTH_SCALE, STEEPEST
from pipeline.models.neumip.model import LAYERS, Neumip, Parts
from pipeline.models.runtimes import as_onnx
from pipeline.shader.constants import shared_constants
from pipeline.shader.descriptor import (
    CONVENTIONS,
    INPUTS,
    OUTPUTS,
    Descriptor,
    Layer,
    Network,
    colours,
    generator,
)
from pipeline.shader.golden import GROUPS, golden_of
from pipeline.shader.shader import Shader
from pipeline.shader.tables import constants_slang
from pipeline.shader.training_domain import trained_ranges, why_outside
from pipeline.shader.weights import MOST_ELEMENTS, Weights, quads
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

NAME: Final = "neumip"
"""Name of the model."""

SOURCES: Final = ("arithmetic.slang", "query.slang", "colours.slang", "perceptron.slang", "neumip.slang")
"""Files of the source."""

_ONNX: Final = {
    "u": "centre along x as a share of the repeat, 0 to 1, (N,)",
    "v": "centre along y as a share of the repeat, (N,)",
    "sigma": "standard deviation of the round footprint, yarn spacings, (N,)",
    "wi": "unit vector to the light, (N, 3)",
    "wo": "unit vector to the viewer, (N, 3)",
}


def neumip_shader(method: Neumip, fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return the model for its fabric; BadInput if a level or kinds are wished, or its textures are too large."""
    if kinds:
        raise BadInput(
            "export", "--kind", ", ".join(sorted(kinds)), f"{method.name} answers in front of flat cloth only"
        )
    if level is not None:
        raise BadInput("export", "--level", level, f"leave it out: {method.name} has no soft nodes")
    parts, weights = method.parts(fabric), Weights()
    yarns = colours(fabric)
    weights.add("colours", np.array([*yarns.model_dump().values()], np.float32)[:4], "k_s and k_d of warp and weft")
    constants, layers = _pack(parts, fabric.weave.repeat, weights)
    channels = [f"feature {n}" for n in range(parts.options.channels)]
    channels += ["0"] * (-len(channels) % 4)
    said = Descriptor(
        model=NAME,
        fabric=fabric.name,
        generator=generator(),
        level=None,
        inputs=INPUTS,
        outputs=OUTPUTS | {"bounds": "the components: the network knows no bound of energy"},
        conventions=[*CONVENTIONS, "An ellipse counts as the circle of its area, curved cloth as flat."],
        colours=yarns,
        repeat=fabric.weave.repeat,
        limits={"elements": MOST_ELEMENTS},
        kinds=[],
        scalars={},
        back_scalars={},
        buffers={"weights": weights.buffer()},
        network=Network(
            name=method.name,
            trained_on=trained_ranges(method.domain),
            outside=why_outside(method.domain, fabric),
            inputs={
                "offset": [*channels, "wo.x", "wo.y", "0", "0"],
                "decoder": [*channels, "wi.x", "wi.y", "wo.x", "wo.y"],
            },
            outputs={
                "offset": "depth d; the place moves by 0.1 d wo.xy / max(wo.z, 0.6) mean sides of the repeat",
                "decoder": f"(exp(x) - 1) / {parts.options.log_k:g} of the specular ones, x of the diffuse; at least 0",
            },
            layers=layers,
            onnx=_ONNX,
        ),
    )
    return Shader(
        NAME,
        SOURCES,
        {
            "layout.slang": constants_slang(shared_constants(), "pipeline.analytic.soft_nodes"),
            "network.slang": constants_slang(constants, "pipeline.models.neumip"),
        },
        weights.files(),
        said,
        golden_of({"front": GROUPS["front"]}, fabric.weave.repeat, partial(_answers, method, fabric), stretched=False),
        f"{weights.count:,} elements",
        False,
        partial(as_onnx, method, fabric, tuple(_ONNX)),
    )


def _pack(parts: Parts, repeat: tuple[int, int], weights: Weights) -> tuple[dict[str, bool | int | float], list[Layer]]:
    """Fill the buffer; return the constants of the source, and what the descriptor says of the layers."""
    options, (ends, picks) = parts.options, repeat
    places, described = {}, []
    for network, layers in (("offset", parts.offset), ("decoder", parts.decoder)):
        places[network] = weights.count
        if layers:
            first = linear.Layer(_after_elements(layers[0].weights, options.channels), layers[0].biases)
            described += weights.add_perceptron(network, [first, *layers[1:]], "ReLU", "none")
    places["pyramid"] = weights.count
    for index, texture in enumerate(parts.levels):
        weights.add(f"level {index}", texture, "texels (rows, columns, channels); row 0 at the smallest v")
    places["depth"] = weights.count
    if parts.depth is not None:
        weights.add("depth", parts.depth, "texels of the depth that shifts a place, at the finest level")
    constants: dict[str, bool | int | float] = {
        "COLOURS": weights.places["colours"].offset,
        "ENDS": ends,
        "PICKS": picks,
        "CHANNEL_QUADS": quads(options.channels),
        "HIDDEN_QUADS": quads(options.hidden),
        "HIDDEN_LAYERS": LAYERS,
        "TEXELS_PER_YARN": options.texels_per_yarn,
        "LEVEL_COUNT": len(parts.levels),
        "OFFSET": options.offset,
        "OFFSET_LAYERS": places["offset"],
        "DECODER_LAYERS": places["decoder"],
        "PYRAMID": places["pyramid"],
        "DEPTH": places["depth"],
        "DEPTH_SCALE": DEPTH_SCALE,
        "STEEPEST": STEEPEST,
        "LOG_K": float(options.log_k),
    }
    return constants, described


def _after_elements(rows: Float32, channels: int) -> Float32:
    """Return weights whose rows of channels are filled up to whole elements, before those of directions."""
    empty = np.zeros((-channels % 4, rows.shape[1]), np.float32)
    return np.concatenate([rows[:channels], empty, rows[channels:]])


def _answers(method: Neumip, fabric: Fabric, queries: Queries) -> Float32:
    """Return the components twice, (N, 8): they are their own bounds."""
    return np.tile(method.predict(fabric, queries), 2)
