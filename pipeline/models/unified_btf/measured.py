"""A material of measured samples as a method: latents that an encoder of RGB made of them, and its decoder.

A black plain weave carries it: its repeat is the patch, in at most `_YARNS` yarns along a side, of about a millimetre
where that is enough. The method answers for that fabric alone, as flat cloth with round footprints: red, green, blue
and 0, in colours of their own. With light or viewer behind it answers 0; renderers take a viewer behind for one in
front.
"""

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from pipeline.compiled.arrays import Float32
from pipeline.models.method import in_chunks, in_repeat
from pipeline.truth.query import Queries
from weaves.fabric import Fabric
from weaves.validation import validated

MEASURED: Final = "measured"  # key of a card
_YARNS: Final = 16
_BLACK: Final = {"bend": 0.0, "roughness": 0.5, "specular": (0.0, 0.0, 0.0), "diffuse": (0.0, 0.0, 0.0)}


class MeasuredCloth:
    """A measured patch that repeats; `about` it are its name and its size in millimetres.

    `rgb` maps tensors u, v, in shares of the patch, sigma in millimetres, wi and wo, of n queries, to RGB (n, 3).
    """

    setting, turns = "", True

    def __init__(self, about: dict[str, Any], rgb: Callable[..., Tensor], numbers: int) -> None:
        self.name, (width, height) = about["name"], map(float, about["size"])
        self._fabric, self._to_rgb, self._numbers = carrier(self.name, (width, height)), rgb, numbers
        ends, picks = self._fabric.weave.repeat
        self._spacing = np.float32((width / ends * height / picks) ** 0.5)  # of yarns, millimetres

    def covers(self, fabric: Fabric) -> bool:
        """Return whether a fabric is the one that carries the patch."""
        return fabric == self._fabric

    def prepare(self, fabric: Fabric) -> None:
        """Do nothing: the samples are encoded."""

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Return red, green, blue and 0 of N queries, float32 (N, 4); 0 if light or viewer is behind."""
        result = np.zeros((len(queries.u), 4), np.float32)
        lit = (queries.wi[:, 2] > 0.0) & (queries.wo[:, 2] > 0.0)
        if lit.any():
            result[lit, :3] = in_chunks(queries.take(lit), self._rgb, 3)
        return result

    def _rgb(self, queries: Queries) -> Float32:
        near = in_repeat(queries, self._fabric.weave.repeat)
        columns = near.u, near.v, near.sigma * self._spacing, near.wi, near.wo
        with torch.inference_mode():
            return self._to_rgb(*map(torch.from_numpy, columns)).numpy()

    def own_colours(self, fabric: Fabric, queries: Queries) -> Float32:
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


def carrier(name: str, size: tuple[float, float]) -> Fabric:
    """Return the fabric whose repeat is a patch of a width and height in mm; BadInput if it cannot have this name."""
    source = "Measured samples; their model answers in colours of its own, and the weave only gives the scale."
    ends, picks = (2 * min(max(round(side / 2), 1), _YARNS // 2) for side in size)
    rows = tuple(("#." if pick % 2 else ".#") * (ends // 2) for pick in range(picks))
    sett = (10.0 * ends / size[0], 10.0 * picks / size[1])
    table = {"name": name, "source": source, "yarns_per_cm": sett, "draft": {"family": "matrix", "rows": rows}}
    return validated(Fabric, table | {"warp": _BLACK, "weft": _BLACK}, "encode")
