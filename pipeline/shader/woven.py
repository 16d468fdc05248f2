"""`woven` as a shader: its decoder with the latent of one fabric.

Latent and picture of the repeat do not depend on a query: their products are part of the first layer.
"""

import math
from collections.abc import Collection
from typing import Final

from pipeline.models.networks.layers import SLOPE
from pipeline.models.woven.decoder import SHARPNESS
from pipeline.models.woven.model import Woven
from pipeline.shader import descriptor
from pipeline.shader.network import Packed, add_layers, coloured_weights, network_shader, refuse_wishes
from pipeline.shader.tables import PlacedArrays
from weaves.errors import BadInput
from weaves.fabric import Fabric

WOVEN: Final = "woven"

_ANGULAR: Final = ("wi.x", "wi.y", "wi.z", "wo.x", "wo.y")
_LEAKY: Final = f"leaky ReLU, {SLOPE:g}"


def woven_shader(method: Woven, fabric: Fabric, level: int | None, kinds: Collection[str]) -> descriptor.Shader:
    """Return the model for a fabric; BadInput if a level or kinds are wished, or its design has no shader."""
    refuse_wishes(method, level, kinds)
    options = method.options
    for key, value, allowed in (
        ("one_blob", options.one_blob, ("local", "plain")),
        ("spatial_fusion", options.spatial_fusion, (True,)),
        ("transmission", options.transmission, (False,)),
        ("bins", options.bins, (4, 8, 16)),
    ):
        if value not in allowed:
            known = f"{method.name} has a shader with {key} = {' or '.join(map(str, allowed))} only"
            raise BadInput("export", "model", f"{key} = {value}", known)
    weights = coloured_weights(fabric)
    return network_shader(WOVEN, method, fabric, weights, _pack(method, fabric, weights))


def _pack(method: Woven, fabric: Fabric, weights: PlacedArrays) -> Packed:
    """Fill the buffer with the layers of a fabric."""
    options, (layers, placement) = method.options, method.layers_of(fabric)
    starts, described, bins = {"FUSION": 0}, [], options.bins
    for name, layer in layers.items():
        starts[name.upper()] = weights.count
        activation = "none" if name == "harmonics" else _LEAKY
        skip = "the input of mix_first is added, then " if name == "mix_second" else ""
        described += add_layers(weights, name, [layer], "", skip + activation)
    (mirror_x, mirror_y), (start, repeat) = placement.mirror[0].tolist(), (placement.start, placement.repeat)
    numbers = {"MIRROR_X": 1 - 2 * mirror_x, "MIRROR_Y": 1 - 2 * mirror_y}
    for axis, name in enumerate("XY"):
        numbers |= {f"START_{name}": start[0, axis], f"REPEAT_{name}": repeat[0, axis]}
    picture = [f"share of cell {n}" for n in range(bins**2)] if options.one_blob == "local" else []
    blobs = [f"{name} blob {n}" for name in ("x", "y", "size") for n in range(bins)]
    return Packed(
        (),
        {
            **starts,
            "BINS": bins,
            "INPUT_QUADS": len(picture + blobs) // 4,
            "HIDDEN_QUADS": -(-options.hidden // 4),
            "FUSED_QUADS": len(layers["last"].weights) // 4,
            "LOCAL": options.one_blob == "local",
            "DEEPER": "fusion" in layers,
            "EXCHANGE": bool(placement.exchange),
            **{name: float(value) for name, value in numbers.items()},
            "SHARPNESS": SHARPNESS,
            "SLOPE": SLOPE,
            "SMALLEST": options.smallest_size,
            "OCTAVES": math.log2(options.largest_size / options.smallest_size),
        },
        described,
        {
            "first": picture + blobs,
            "angular": [*(f"fused {n}" for n in range(len(layers["last"].weights))), *_ANGULAR],
            "harmonics": [f"{wave} of {m} periods" for wave in ("cosine", "sine") for m in range(1, bins)],
        },
        {
            "harmonics": "shares of a periodic Gaussian in the bins, of its cosines and sines times their decay",
            "last": f"(exp(x) - 1) / {options.log_k:g} of the specular ones, x of the diffuse; at least 0",
        },
    )
