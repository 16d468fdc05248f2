"""`selvage` as a shader: the soft nodes' tables, and the weights of the correction for one fabric."""

from __future__ import annotations

from collections.abc import Collection
from functools import partial
from typing import Final

import numpy as np

from pipeline.analytic.soft_nodes import features
from pipeline.analytic.soft_nodes.features import OF_QUERY
from pipeline.compiled.arrays import Float32
from pipeline.models.runtimes import as_onnx
from pipeline.models.selvage.error_network import SLOPE
from pipeline.models.selvage.model import LARGEST, Selvage
from pipeline.shader import descriptor as said
from pipeline.shader.descriptor import Network, descriptor
from pipeline.shader.golden import golden, read_sides
from pipeline.shader.shader import Shader
from pipeline.shader.sides import Sides, tabulate_sides
from pipeline.shader.soft_nodes import SOURCES as OF_SOFT_NODES
from pipeline.shader.soft_nodes import refuse_large_repeat, size_of, table_files
from pipeline.shader.tables import constants_slang, layout_slang, tables
from pipeline.shader.training_domain import trained_ranges, why_outside
from pipeline.shader.weights import Weights, quads
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

NAME: Final = "selvage"
"""Name of the model."""

SOURCES: Final = (*OF_SOFT_NODES, "perceptron.slang", "selvage.slang")
"""Files of the source."""

_BY_FAMILY: Final = (
    "share of the area seen, 0 to 1",
    "area seen over that with nothing hidden",
    "diffuse light with shadows over that without hiding",
    "specular light with shadows over that without hiding",
    "twice the share of the diffuse light within ramps of horizons",
    "twice the share of the specular light within ramps of horizons",
    "s / (s + 0.05) of the specular component s, 1/sr",
    "c / (c + 0.05) of the diffuse component c, 1/sr",
)
_FEATURES: Final = (
    *(f"{family}: {text}" for family in ("warp", "weft") for text in _BY_FAMILY),
    *(
        f"{name}.{axis}, mirrored so that (wi + wo).x and .y are not negative"
        for name in ("wi", "wo")
        for axis in "xyz"
    ),
    *(f"slope of the half vector along {axis}, at most 3" for axis in "xy"),
    "wi . wo",
    "seen share q of the bare area",
    "s / (s + 0.1) of the footprint s, the geometric mean of its deviations in yarn spacings",
    "r / (r + 0.02) of r = sqrt(q)",
    "twist of the warp, radians; its sign changes with each mirror",
    "twist of the weft",
)


def selvage_shader(method: Selvage, fabric: Fabric, level: int | None, kinds: Collection[str]) -> Shader:
    """Return the model for a fabric.

    Parameters
    ----------
    method : Selvage
        The trained model.
    fabric : Fabric
        The cloth.
    level : int, optional
        Level of detail of the soft nodes: that of the training.
    kinds : collection of str
        Of KINDS.

    Raises
    ------
    BadInput
        If another level is wished, or the cloth is too large.
    """
    trained = method.options.level
    if level not in (None, trained):
        raise BadInput("export", "--level", level, f"leave it out: {method.name} was trained with level {trained}")
    refuse_large_repeat(fabric)
    sides = tabulate_sides(fabric, trained, kinds)
    found, (weights, described, network) = tables(sides), correction(method, fabric)
    about_tables = descriptor(fabric, trained, found, kinds)
    about = Network(
        name=method.name,
        trained_on=trained_ranges(method.domain),
        outside=why_outside(method.domain, fabric),
        inputs={"correction": list(_FEATURES)},
        outputs={"correction": "factors of the components of the soft nodes; the products are at most the bounds"},
        layers=described,
        onnx={
            "features": f"inputs of the correction, (N, {OF_QUERY})",
            "soft_components": "components of the soft nodes, (N, 4)",
            "soft_bounds": "bounds of the soft nodes, (N, 4)",
        },
    )
    return Shader(
        NAME,
        SOURCES,
        {"layout.slang": layout_slang(found), "network.slang": network},
        table_files(found) | weights.files(),
        about_tables.model_copy(
            update={"model": NAME, "network": about, "buffers": {**about_tables.buffers, "weights": weights.buffer()}}
        ),
        golden(sides, partial(_answers, method, fabric, sides)),
        size_of(trained, sides),
        True,
        partial(as_onnx, method, fabric, tuple(about.onnx)),
    )


def correction(method: Selvage, fabric: Fabric) -> tuple[Weights, list[said.Layer], str]:
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
        "LARGEST": LARGEST,
        "BOUNDED": method.bound,
        **{name: float(own[f"_{name}"]) for name in ("DARK", "SMALL", "STEEPEST")},
        "ALMOST_HIDDEN": float(own["_HIDDEN"]),
    }
    return weights, described, constants_slang(constants, "pipeline.models.selvage")


def _answers(method: Selvage, fabric: Fabric, sides: Sides, queries: Queries) -> Float32:
    """Return the soft nodes' answers, with corrected components in front, (N, ANSWERS)."""
    result = read_sides(sides, queries)
    front = (queries.wi[:, 2] > 0.0) & (queries.wo[:, 2] > 0.0)
    if front.any():
        result[front, :4] = method.predict(fabric, queries.take(front))
    return result
