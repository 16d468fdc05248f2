"""A material of measured samples as a method: latents that an encoder of RGB made of them, and its decoder.

A black plain weave of two yarns tells renderers where it lies: one yarn spacing is a millimetre of the patch. The
method answers for that fabric alone, from both sides alike, as flat cloth with round footprints: red, green, blue and
0, in colours of their own. Light from behind gives 0.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from pipeline.compiled.arrays import Float32
from pipeline.models.method import in_chunks
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.validation import validated

MEASURED: Final = "measured"  # key of a card
_BLACK: Final = {"bend": 0.0, "roughness": 0.5, "specular": (0.0, 0.0, 0.0), "diffuse": (0.0, 0.0, 0.0)}


class MeasuredCloth:
    """A measured patch that repeats; `about` it are its name and its size in millimetres.

    `rgb` maps tensors u, v, in shares of the patch, sigma in millimetres, wi and wo, of n queries, to RGB (n, 3).
    """

    setting, turns = "", True

    def __init__(self, about: dict[str, Any], rgb: Callable[..., Tensor], numbers: int) -> None:
        self.name, self.size = about["name"], tuple(map(float, about["size"]))
        self._fabric, self._to_rgb, self._numbers = carrier(self.name), rgb, numbers

    def covers(self, fabric: Fabric) -> bool:
        """Return whether a fabric is the one that carries the patch."""
        return fabric == self._fabric

    def prepare(self, fabric: Fabric) -> None:
        """Do nothing: the samples are encoded."""

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Return red, green, blue and 0 of N queries, float32 (N, 4); 0 for light from behind."""
        result = np.zeros((len(queries.u), 4), np.float32)
        lit = (queries.wi[:, 2] > 0.0) & (queries.wo[:, 2] > 0.0)
        if lit.any():
            result[lit, :3] = in_chunks(queries.take(lit), self._rgb, 3)
        return result

    def _rgb(self, queries: Queries) -> Float32:
        places = zip((queries.u, queries.v), self.size, strict=True)
        u, v = (np.mod(place.astype(np.float64) / side, 1.0).astype(np.float32) for place, side in places)
        with torch.inference_mode():
            return self._to_rgb(*map(torch.from_numpy, (u, v, queries.sigma, queries.wi, queries.wo))).numpy()

    def colours(self, fabric: Fabric, queries: Queries) -> Float32:
        """Return the colours of its answers, (N, 4, 3)."""
        return np.broadcast_to(np.eye(4, 3, dtype=np.float32), (len(queries.u), 4, 3))

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return 0: no light goes through."""
        return np.zeros(len(looks.u), np.float32)

    def coverage(self, fabric: Fabric, looks: Queries) -> Float32:
        """Return 1: every view ray meets the cloth."""
        return np.ones(len(looks.u), np.float32)

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of latents and decoder, float32."""
        return 4 * self._numbers


def carrier(name: str) -> Fabric:
    """Return the fabric that carries a measured patch; BadInput if it cannot have this name."""
    source = "Measured samples; their model answers in colours of its own, and the weave only gives the scale."
    table = {"name": name, "source": source, "yarns_per_cm": (10.0, 10.0), "draft": {"family": "plain"}}
    return validated(Fabric, table | {"warp": _BLACK, "weft": _BLACK}, "encode")
