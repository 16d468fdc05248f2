"""Models with networks as shaders: `selvage` corrects the soft nodes, `neumip` has the textures of one fabric.

Both keep their networks in one more buffer, `weights`, in elements of four numbers. A layer has its biases first, then
its weights row after row, one row an input. Rows are filled up with zeros to whole elements, and inputs to a multiple
of four, so that the shader multiplies vectors.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial
from typing import Final

import numpy as np

from pipeline.analytic.soft_nodes import features
from pipeline.analytic.soft_nodes.features import OF_QUERY
from pipeline.compiled.arrays import Float32
from pipeline.models.networks.layers import SLOPE, LinearLayer, layers_of
from pipeline.models.networks.texture import DEPTH_SCALE, LAYERS, STEEPEST, texels_of
from pipeline.models.neumip.model import Neumip, NeumipNetwork
from pipeline.models.runtimes import as_onnx
from pipeline.models.selvage.model import LARGEST_FACTOR, Selvage
from pipeline.scenes.shade import colours as linear_colours
from pipeline.shader.constants import TEXTURE_WIDTH, shared_constants
from pipeline.shader.descriptor import (
    CONVENTIONS,
    OUTPUTS,
    Buffer,
    Descriptor,
    Networks,
    PlacedLayer,
    Shader,
    colours,
    descriptor,
    threads_of,
    trained_ranges,
    why_outside,
)
from pipeline.shader.golden import GROUPS, golden, golden_of, read_sides
from pipeline.shader.limits import MOST_HEIGHT
from pipeline.shader.soft_nodes import SOFT_NODES_SOURCES, nodes_of
from pipeline.shader.tables import (
    Place,
    Sides,
    constants_slang,
    layout_slang,
    refuse_large_repeat,
    table_files,
    tables,
    tabulate_sides,
)
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

SELVAGE: Final = "selvage"
SELVAGE_SOURCES: Final = (*SOFT_NODES_SOURCES, "perceptron.slang", "selvage.slang")

NEUMIP: Final = "neumip"
NEUMIP_SOURCES: Final = ("arithmetic.slang", "query.slang", "colours.slang", "perceptron.slang", "neumip.slang")

MOST_ELEMENTS: Final = TEXTURE_WIDTH * MOST_HEIGHT
"""Most elements of the buffer: of a texture that every WebGL 2 allows."""


def quads(count: int) -> int:
    """Return how many elements of four hold so many numbers."""
    return -(-count // 4)


class Weights:
    """Arrays, one after another, that fill whole elements."""

    def __init__(self) -> None:
        self._parts: list[Float32] = []
        self.count = 0
        self.places: dict[str, Place] = {}

    def add(self, name: str, values: Float32, meaning: str) -> Place:
        """Append an array whose last axis is filled up to whole elements, and return its place."""
        width = 4 * quads(values.shape[-1])
        filled = np.zeros((*values.shape[:-1], width), np.float32)
        filled[..., : values.shape[-1]] = values
        place = Place(offset=self.count, shape=filled.shape, meaning=meaning)
        self._parts.append(filled.ravel())
        self.count += filled.size // 4
        self.places[name] = place
        return place

    def add_perceptron(
        self, network: str, layers: Sequence[LinearLayer], activation: str, last: str
    ) -> list[PlacedLayer]:
        """Append the layers of a network; inputs of the first one are filled up to whole elements.

        `activation` is the function of the outputs of all layers but the last, `last` that of the last.
        """
        described = []
        for index, layer in enumerate(layers):
            rows = np.zeros((4 * quads(len(layer.weights)), layer.weights.shape[1]), np.float32)
            rows[: len(layer.weights)] = layer.weights
            name = f"{network} {index}"
            described.append(
                PlacedLayer(
                    network=network,
                    biases=self.add(f"{name} biases", layer.biases, "biases"),
                    weights=self.add(f"{name} weights", rows, "weights (inputs, outputs)"),
                    activation=last if index == len(layers) - 1 else activation,
                )
            )
        return described

    def buffer(self) -> Buffer:
        """Return the description of the buffer."""
        return Buffer(
            files={"float32": "tables/weights.f32", "float16": "tables/weights.f16"},
            channels=4,
            elements=self.count,
            arrays=self.places,
        )

    @property
    def values(self) -> Float32:
        """All numbers of the buffer."""
        return np.concatenate(self._parts)

    def files(self) -> dict[str, bytes]:
        """Return its files, by their paths; BadInput for more than MOST_ELEMENTS."""
        if self.count > MOST_ELEMENTS:
            allowed = f"the shader takes at most {MOST_ELEMENTS:,} elements of weights"
            raise BadInput("export", "shader", f"{self.count:,} elements", allowed)
        return {
            "tables/weights.f32": self.values.astype("<f4").tobytes(),
            "tables/weights.f16": self.values.astype("<f2").tobytes(),
        }


_SELVAGE_BY_FAMILY: Final = (
    "share of the area seen, 0 to 1",
    "area seen over that with nothing hidden, at most 2",
    "diffuse light with shadows over that without hiding, at most 2",
    "specular light with shadows over that without hiding, at most 2",
    "twice the share of the diffuse light within ramps of horizons, 0 to 1",
    "twice the share of the specular light within ramps of horizons, 0 to 1",
    "s / (s + 0.05) of the specular component s, 1/sr",
    "c / (c + 0.05) of the diffuse component c, 1/sr",
)
_SELVAGE_INPUTS: Final = (
    *(f"{family}: {text}" for family in ("warp", "weft") for text in _SELVAGE_BY_FAMILY),
    *(
        f"{name}.{axis}, mirrored so that (wi + wo).x and .y are not negative"
        for name in ("wi", "wo")
        for axis in "xyz"
    ),
    *(f"slope of the half vector along {axis}, at most 3" for axis in "xy"),
    "wi . wo",
    "seen share q of the bare area, at most 2",
    "s / (s + 0.1) of the footprint s, the geometric mean of its deviations in yarn spacings",
    "r / (r + 0.02) of r = sqrt(q)",
    "twist of the warp, radians; its sign changes with each mirror",
    "twist of the weft",
)


def selvage_shader(method: Selvage, fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return the model for a fabric; BadInput for another level than that of its training, or too large cloth."""
    trained = method.options.level
    if level not in (None, trained):
        raise BadInput("export", "level", level, f"leave it out: {method.name} was trained with level {trained}")
    refuse_large_repeat(fabric)
    sides = tabulate_sides(fabric, trained, kinds, method.options.walls == "rim")
    cloth, (weights, described, network) = tables(sides), correction(method, fabric)
    about_tables = descriptor(fabric, trained, cloth, kinds)
    about = Networks(
        name=method.name,
        trained_on=trained_ranges(method.domain),
        outside=why_outside(method.domain, fabric),
        inputs={"correction": list(_SELVAGE_INPUTS)},
        outputs={"correction": "factors of the components of the soft nodes; the products are at most the bounds"},
        layers=described,
        onnx={
            "features": f"inputs of the correction, (N, {OF_QUERY})",
            "soft_components": "components of the soft nodes, (N, 4)",
            "soft_bounds": "bounds of the soft nodes, (N, 4)",
        },
    )
    return Shader(
        SELVAGE,
        SELVAGE_SOURCES,
        {"layout.slang": layout_slang(cloth), "network.slang": network},
        table_files(cloth) | weights.files(),
        about_tables.model_copy(
            update={
                "model": SELVAGE,
                "network": about,
                "buffers": {**about_tables.buffers, "weights": weights.buffer()},
            }
        ),
        golden(sides, partial(_selvage_answers, method, fabric, sides)),
        nodes_of(trained, sides),
        True,
        partial(as_onnx, method, fabric, tuple(about.onnx)),
        max(about_tables.threads) > 1,
    )


def correction(method: Selvage, fabric: Fabric) -> tuple[Weights, list[PlacedLayer], str]:
    """Return the weights of the network for a fabric, what they are, and `network.slang`, equal for all fabrics."""
    weights, layers = Weights(), method.layers(fabric)
    twists = np.radians([[yarn.twist for yarn in (fabric.warp, fabric.weft)]]).astype(np.float32)
    weights.add("twists", twists, "twists of warp and weft, radians")
    first = weights.count
    described = weights.add_perceptron("correction", layers, f"leaky ReLU of slope {SLOPE}", "2 / (1 + exp(-x))")
    own = vars(features)
    constants = {
        "FEATURE_QUADS": quads(OF_QUERY),
        "WIDTH_QUADS": quads(method.options.width),
        "HIDDEN_LAYERS": len(layers) - 1,
        "FIRST_LAYER": first,
        "SLOPE": SLOPE,
        "LARGEST": LARGEST_FACTOR,
        "BOUNDED": method.bound,
        **{name: float(own[f"_{name}"]) for name in ("DARK", "SMALL", "STEEPEST", "MOST_SEEN")},
        "ALMOST_HIDDEN": float(own["_HIDDEN"]),
    }
    return weights, described, constants_slang(constants, "pipeline.models.selvage")


def _selvage_answers(method: Selvage, fabric: Fabric, sides: Sides, queries: Queries) -> Float32:
    """Return the soft nodes' answers, with corrected components in front, (N, ANSWER_COLUMNS)."""
    result = read_sides(sides, queries)
    front = (queries.wi[:, 2] > 0.0) & (queries.wo[:, 2] > 0.0)
    if front.any():
        result[front, :4] = method.predict(fabric, queries.take(front))
    return result


_NEUMIP_ONNX: Final = {
    "u": "centre along x as a share of the repeat, 0 to 1, (N,)",
    "v": "centre along y as a share of the repeat, (N,)",
    "sigma": "standard deviation of the round footprint, yarn spacings, (N,)",
    "wi": "unit vector to the light, (N, 3)",
    "wo": "unit vector to the viewer, (N, 3)",
}


def neumip_shader(method: Neumip, fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return the model for its fabric; BadInput if a level or kinds are wished, or its textures are too large."""
    if kinds:
        raise BadInput("export", "kind", ", ".join(sorted(kinds)), f"{method.name} answers in front of flat cloth only")
    if level is not None:
        raise BadInput("export", "level", level, f"leave it out: {method.name} has no soft nodes")
    network, weights = method.network_of(fabric), Weights()
    options = network.options
    yarns = colours(fabric)
    weights.add("colours", np.array([*yarns.model_dump().values()], np.float32)[:4], "k_s and k_d of warp and weft")
    constants, layers = _pack(network, weights)
    channels = [f"feature {n}" for n in range(options.channels)]
    channels += ["0"] * (-len(channels) % 4)
    described = Descriptor(
        model=NEUMIP,
        fabric=fabric.name,
        level=None,
        outputs=OUTPUTS | {"bounds": "the components: the network knows no bound of energy"},
        conventions=[*CONVENTIONS, "An ellipse counts as the circle of its area, curved cloth as flat."],
        colours=yarns,
        repeat=fabric.weave.repeat,
        threads=threads_of(fabric),
        limits={"elements": MOST_ELEMENTS},
        kinds=[],
        scalars={},
        back_scalars={},
        buffers={"weights": weights.buffer()},
        network=Networks(
            name=method.name,
            trained_on=trained_ranges(method.domain),
            outside=why_outside(method.domain, fabric),
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
    return Shader(
        NEUMIP,
        NEUMIP_SOURCES,
        {
            "layout.slang": constants_slang(shared_constants(), "pipeline.analytic.soft_nodes"),
            "network.slang": constants_slang(constants, "pipeline.models.neumip"),
        },
        weights.files(),
        described,
        golden_of(
            {"front": GROUPS["front"]},
            fabric.weave.repeat,
            partial(_neumip_answers, method, fabric),
            lambda queries: np.tile(linear_colours(fabric), (len(queries.u), 1, 1)),
            stretched=False,
        ),
        f"{weights.count:,} elements",
        False,
        partial(as_onnx, method, fabric, tuple(_NEUMIP_ONNX)),
    )


def _pack(network: NeumipNetwork, weights: Weights) -> tuple[dict[str, bool | int | float], list[PlacedLayer]]:
    """Fill the buffer; return the constants of the source, and what the descriptor says of the layers."""
    options, (ends, picks) = network.options, network.repeat
    places, described = {}, []
    for name, perceptron in (("offset", network.offset), ("decoder", network.decoder)):
        places[name] = weights.count
        if perceptron is not None:
            layers = layers_of(perceptron)
            first = LinearLayer(_after_elements(layers[0].weights, options.channels), layers[0].biases)
            described += weights.add_perceptron(name, [first, *layers[1:]], "ReLU", "none")
    places["pyramid"] = weights.count
    for index, texture in enumerate(network.levels):
        weights.add(f"level {index}", texels_of(texture), "texels (rows, columns, channels); row 0 at the smallest v")
    places["depth"] = weights.count
    if network.depth is not None:
        weights.add("depth", texels_of(network.depth), "texels of the depth that shifts a place, at the finest level")
    constants: dict[str, bool | int | float] = {
        "COLOURS": weights.places["colours"].offset,
        "ENDS": ends,
        "PICKS": picks,
        "CHANNEL_QUADS": quads(options.channels),
        "HIDDEN_QUADS": quads(options.hidden),
        "HIDDEN_LAYERS": LAYERS,
        "TEXELS_PER_YARN": options.texels_per_yarn,
        "LEVEL_COUNT": len(network.levels),
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


def _neumip_answers(method: Neumip, fabric: Fabric, queries: Queries) -> Float32:
    """Return the components twice, (N, 8): they are their own bounds."""
    return np.tile(method.predict(fabric, queries), 2)
