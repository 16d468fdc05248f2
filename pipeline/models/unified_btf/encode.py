"""Make a material of measured samples by a trained encoder of RGB: one forward pass."""

from pathlib import Path
from typing import Final

import safetensors.torch
import torch

from pipeline.atomic import atomic_write, refuse_unwritable
from pipeline.fingerprint import IDENTITY
from pipeline.models.card import CARD, read_card, write_model
from pipeline.models.network import NetworkMethod
from pipeline.models.registry import load_model, model_folder
from pipeline.models.unified_btf.measured import MEASURED, carrier
from pipeline.models.unified_btf.model import LATENTS, RgbBtfNetwork, angles_of
from pipeline.shards.sample_file import read_samples
from weaves.errors import BadInput

FABRIC_FILE: Final = "fabric.toml"

_SIDES: Final = (0.1, 1000.0)  # of a patch, millimetres


def encode(
    samples: Path, texels: tuple[int, int] | None, model: Path, name: str, size: tuple[float, float], out: Path
) -> None:
    """Write the material of a file of samples to a folder: a model, and the fabric that it answers for.

    `samples` and `texels` are as for `read_samples`, `model` is the folder of a trained ``unified_btf`` with ``head =
    "rgb"``, `size` the width and height of the patch in millimetres. BadInput if a sample cannot be used, there is no
    such model, name or size cannot be used, or `out` is the folder of another model.
    """
    # What takes no time is checked before the samples are read.
    low, high = _SIDES
    if not all(low <= side <= high for side in size):
        raise BadInput("encode", "size", f"{size[0]:g}x{size[1]:g}", f"each side must be from {low:g} to {high:g} mm")
    fabric, folder = carrier(name, size), model_folder(str(model), "encode", "model", [])
    (method, *_) = load_model(folder)
    network = method.network_of(fabric) if isinstance(method, NetworkMethod) and method.covers(fabric) else None
    if not isinstance(network, RgbBtfNetwork):
        raise BadInput("encode", "model", str(model), 'must be a trained unified_btf with head = "rgb"')
    if (out / CARD).exists() and MEASURED not in read_card(out):
        raise BadInput("encode", "out", str(out), "holds a trained model; name another folder")
    refuse_unwritable(out / FABRIC_FILE)
    shape, *columns = read_samples(samples, texels)
    texel, wi, wo, rgb = map(torch.from_numpy, columns)
    with torch.inference_mode():
        latents = network.encoder.of_rows(texel, angles_of(wi, wo), rgb, shape[0] * shape[1])
    weights = {f"decoder.{key}": values for key, values in network.decoder.state_dict().items()}
    card = {
        "options": network.options.model_dump(mode="json", context=IDENTITY),
        "version": {"model": network.options.version},
        MEASURED: {"name": name, "size": size, "samples": len(texel)},
    }
    write_model(out, safetensors.torch.save(weights | {LATENTS: latents.reshape(*shape, -1)}), card)
    atomic_write(out / FABRIC_FILE, fabric.to_toml().encode())
