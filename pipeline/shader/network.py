"""Networks as shaders: what the models `neumip`, `curved` and `woven` share.

All numbers fill one buffer, `weights`, in elements of four. A layer has its biases first, then its weights row after
row, one row an input. Rows are filled up with zeros to whole elements, and inputs to a multiple of four, so that the
shader multiplies vectors.
"""

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.models.domain import Domain
from pipeline.models.network import NetworkMethod
from pipeline.models.networks.layers import LinearLayer
from pipeline.models.runtimes import as_onnx
from pipeline.scenes.shade import colours
from pipeline.shader import descriptor
from pipeline.shader.constants import TEXTURE_WIDTH, shared_constants
from pipeline.shader.golden import GROUPS, golden_of
from pipeline.shader.limits import MOST_HEIGHT
from pipeline.shader.tables import PlacedArrays, constants_slang, encoded
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

SHARED_SOURCES: Final = ("arithmetic.slang", "query.slang", "colours.slang", "perceptron.slang")

MOST_ELEMENTS: Final = TEXTURE_WIDTH * MOST_HEIGHT
"""Most elements of the buffer: of a texture that every WebGL 2 allows."""

_ONNX: Final = {
    "u": "centre along x as a share of the repeat, 0 to 1, (N,)",
    "v": "centre along y as a share of the repeat, (N,)",
    "sigma": "standard deviation of the round footprint, yarn spacings, (N,)",
    "wi": "unit vector to the light, (N, 3)",
    "wo": "unit vector to the viewer, (N, 3)",
    "curvature": "of the cloth in the viewer's plane, 1/yarn spacings, (N,)",
}


class Packed(NamedTuple):
    """A network in the buffer `weights`, the constants of its source, and what the descriptor says of it."""

    sources: tuple[str, ...]  # files of the source beside those that all share
    constants: dict[str, bool | int | float]
    layers: list[descriptor.PlacedLayer]
    inputs: dict[str, list[str]]  # of each network, in their order
    outputs: dict[str, str]
    curvature: float = 0.0  # largest that it knows


def add_layers(
    buffer: PlacedArrays, network: str, layers: Sequence[LinearLayer], activation: str, last: str = "none"
) -> list[descriptor.PlacedLayer]:
    """Append layers that follow each other, with their activations; inputs are filled up to whole elements."""
    described = []
    for index, layer in enumerate(layers):
        rows, name = np.pad(layer.weights, ((0, -len(layer.weights) % 4), (0, 0))), f"{network} {index}"
        biases = buffer.add(f"{name} biases", layer.biases, "biases")
        weights = buffer.add(f"{name} weights", rows, "weights (inputs, outputs)")
        own = last if index == len(layers) - 1 else activation
        described.append(descriptor.PlacedLayer(network=network, biases=biases, weights=weights, activation=own))
    return described


def coloured_weights(fabric: Fabric) -> PlacedArrays:
    """Return a buffer that begins with the colours of a fabric."""
    weights = PlacedArrays(channels=4)
    weights.add("colours", colours(fabric).astype(np.float32), "k_s and k_d of warp and weft")
    return weights


def refuse_wishes(method: NetworkMethod[Any], level: int | None, kinds: Collection[str]) -> None:
    """Refuse a level of detail, and kinds of queries that the shader of a method does not know."""
    known = {"curvature"} & method.options.kinds
    if wrong := sorted(set(kinds) - known):
        where = "in front of cloth" if known else "in front of flat cloth"
        raise BadInput("export", "kind", ", ".join(wrong), f"{method.name} answers {where} only")
    if level is not None:
        raise BadInput("export", "level", level, f"leave it out: {method.name} has no soft nodes")


def network_shader(
    model: str, method: NetworkMethod[Any], fabric: Fabric, weights: PlacedArrays, packed: Packed
) -> descriptor.Shader:
    """Return the shader of a model whose network fills `weights`; BadInput if it is too large."""
    if weights.count > MOST_ELEMENTS:
        allowed = f"the shader takes at most {MOST_ELEMENTS:,} elements of weights"
        raise BadInput("export", "shader", f"{weights.count:,} elements", allowed)
    trained_on, outside = _training(method.domain, fabric)
    bent = f"a larger curvature than {packed.curvature:g} as this one" if packed.curvature else "curved cloth as flat"
    groups = ("front", "curved") if packed.curvature else ("front",)
    names = method.network_of(fabric).columns
    ends, picks = fabric.thread_colours()
    files = {"float32": "tables/weights.f32", "float16": "tables/weights.f16"}
    buffer = descriptor.Buffer(files=files, channels=4, elements=weights.count, arrays=weights.places)
    described = descriptor.Descriptor(
        model=model,
        fabric=fabric.name,
        outputs=descriptor.OUTPUTS | {"bounds": "the components: the network knows no bound of energy"},
        conventions=[*descriptor.CONVENTIONS, f"An ellipse counts as the circle of its area, {bent}."],
        kinds=["curvature"] if packed.curvature else [],
        colours=descriptor.colours(fabric),
        repeat=fabric.weave.repeat,
        threads=(len(ends.diffuse), len(picks.diffuse)),
        limits={"elements": MOST_ELEMENTS},
        buffers={"weights": buffer},
        network=descriptor.Networks(
            name=method.name,
            trained_on=trained_on,
            outside=outside,
            inputs=packed.inputs,
            outputs=packed.outputs,
            layers=packed.layers,
            onnx={name: _ONNX[name] for name in names},
        ),
    )
    ends_picks = dict(zip(("ENDS", "PICKS"), fabric.weave.repeat, strict=True))

    def read(queries: Queries) -> Float32:
        bend = np.minimum(queries.curvature, np.float32(packed.curvature))
        return np.tile(method.predict(fabric, queries._replace(curvature=bend)), 2)  # components are their own bounds

    constants: Mapping[str, bool | int | float] = {
        "COLOURS": weights.places["colours"].offset,
        **ends_picks,
        **packed.constants,
        "LOG_K": float(method.options.log_k),
    }
    return descriptor.Shader(
        (*SHARED_SOURCES, *packed.sources, f"{model}.slang"),
        {
            "layout.slang": constants_slang(shared_constants(), "pipeline.analytic.soft_nodes"),
            "network.slang": constants_slang(dict(constants), f"pipeline.models.{model}"),
        },
        {path: encoded(np.concatenate(weights.parts), kind) for kind, path in files.items()},
        described,
        golden_of(
            {name: GROUPS[name] for name in groups},
            fabric.weave.repeat,
            read,
            lambda queries: np.tile(colours(fabric), (len(queries.u), 1, 1)),
            stretched=False,
        ),
        f"{weights.count:,} elements",
        False,
        partial(as_onnx, method, fabric, names),
    )


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
