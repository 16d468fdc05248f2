"""Every choice the papers leave open, as named options of each model: each file holds those of the model of its name.

Options are data: they enter the fingerprint of a trained model, and a recipe's ``[[models]]`` table is validated by
`ModelOptions`, the union told apart by ``model``. Nothing heavy is imported here, so that plans can be made without
torch.
"""

from __future__ import annotations

from typing import Annotated, get_args

from pydantic import Field

from pipeline.models.options.base import Options
from pipeline.models.options.btf_autoencoder import BtfAutoencoderOptions
from pipeline.models.options.curved import CurvedOptions
from pipeline.models.options.neumip import NeumipOptions
from pipeline.models.options.point_sampled import PointSampledOptions
from pipeline.models.options.prefiltered import PrefilteredOptions
from pipeline.models.options.quadrature import QuadratureOptions
from pipeline.models.options.selvage import SelvageOptions
from pipeline.models.options.sums import SumsOptions
from pipeline.models.options.table import TableOptions
from pipeline.models.options.unified_btf import BtfOptions, UnifiedBtfOptions
from pipeline.models.options.woven import WovenOptions

ModelOptions = Annotated[
    WovenOptions
    | NeumipOptions
    | CurvedOptions
    | PointSampledOptions
    | UnifiedBtfOptions
    | BtfAutoencoderOptions
    | TableOptions
    | QuadratureOptions
    | PrefilteredOptions
    | SelvageOptions
    | SumsOptions,
    Field(discriminator="model"),
]
"""Any model's options, told apart by `model`."""

CLASSES: dict[str, type[Options]] = {
    kind.model_fields["model"].default: kind for kind in get_args(get_args(ModelOptions)[0])
}
"""The options' class of every model, by the name of its file."""

__all__ = [
    "CLASSES",
    "BtfAutoencoderOptions",
    "BtfOptions",
    "CurvedOptions",
    "ModelOptions",
    "NeumipOptions",
    "Options",
    "PointSampledOptions",
    "PrefilteredOptions",
    "QuadratureOptions",
    "SelvageOptions",
    "SumsOptions",
    "TableOptions",
    "UnifiedBtfOptions",
    "WovenOptions",
]
