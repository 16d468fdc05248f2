"""Make a material of measured samples by a trained encoder of RGB: one forward pass."""

from pathlib import Path
from typing import Final

import safetensors.torch
import torch

from pipeline.atomic import atomic_write
from pipeline.fingerprint import IDENTITY
from pipeline.models.card import write_model
from pipeline.models.network import NetworkMethod
from pipeline.models.registry import load_model
from pipeline.models.unified_btf.measured import MEASURED, carrier
from pipeline.models.unified_btf.model import LATENTS, RgbBtfNetwork, angles_of
from pipeline.shards.sample_file import MeasuredSamples
from weaves.errors import BadInput

FABRIC_FILE: Final = "fabric.toml"

_LONGEST: Final = 10_000.0  # side of a patch, millimetres


def encode(samples: MeasuredSamples, model: Path, name: str, size: tuple[float, float], out: Path) -> None:
    """Write the material of samples to a folder: a model, and the fabric that it answers for.

    `model` is the folder of a trained ``unified_btf`` with ``head = "rgb"``, `size` the width and height of the patch
    in millimetres. BadInput if there is no such model, or name or size cannot be used.
    """
    fabric, (method, *_) = carrier(name), load_model(model)
    network = method.network_of(fabric) if isinstance(method, NetworkMethod) and method.covers(fabric) else None
    if not isinstance(network, RgbBtfNetwork):
        raise BadInput("encode", "--model", str(model), 'must be a trained unified_btf with head = "rgb"')
    if not all(0.0 < side <= _LONGEST for side in size):
        raise BadInput("encode", "--size", f"{size[0]:g}x{size[1]:g}", f"must be above 0, at most {_LONGEST:g} mm")
    rows, columns = samples.shape
    texel, wi, wo, rgb = (torch.from_numpy(column) for column in samples[1:])
    with torch.inference_mode():
        latents = network.encoder.of_rows(texel, angles_of(wi, wo), rgb, rows * columns)
    weights = {f"decoder.{key}": values for key, values in network.decoder.state_dict().items()}
    card = {
        "options": network.options.model_dump(mode="json", context=IDENTITY),
        "version": {"model": network.options.version},
        MEASURED: {"name": name, "size": size, "samples": len(texel)},
    }
    write_model(out, safetensors.torch.save(weights | {LATENTS: latents.reshape(rows, columns, -1)}), card)
    atomic_write(out / FABRIC_FILE, fabric.to_toml().encode())
