"""Figures on held-out queries for the model card, each beside the noise of the truth it was measured against.

A mean squared error against a noisy truth is the model's own plus the noise, the mean squared standard error: both
are on the card.
"""

import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from pipeline.compiled.arrays import Float32
from pipeline.models.network import Batch
from pipeline.models.registry import restore_methods
from pipeline.shards.manifest import Manifest
from pipeline.truth.conventions import COMPONENTS
from pipeline.truth.query import Answers, Queries

FOOTPRINTS = (0.1, 0.3, 1.0, 4.0)  # edges between the bins of footprints, in yarn spacings

_LOOK_ROWS = 2048  # most queries of a look during the training


class HeldOut:
    """Held-out queries of trained fabrics, at most `rows` in all; `options` and `card` are for `restore_methods`."""

    def __init__(self, options: Any, card: dict[str, Any], manifest: Manifest, folder: Path, rows: int) -> None:
        self._options, self._card, self._manifest = options, card, manifest
        held_out = {shard.fabric for shard in manifest.shards if shard.split == "validation"}
        names = [entry["name"] for entry in card["fabrics"] if entry["name"] in held_out]
        self._rows = {name: manifest.read(folder, name, "validation") for name in names}
        self._share = max(rows // max(len(names), 1), 1)
        self._look = max(min(self._share, _LOOK_ROWS // max(len(names), 1)), 1)

    def batch(self, device: torch.device) -> Batch | None:
        """Return held-out queries with their targets as a step of the training sees them; None without queries."""
        if not self._rows:
            return None
        each = min(self._look, *(len(queries.u) for queries, _ in self._rows.values()))
        order = [entry["name"] for entry in self._card["fabrics"]]
        fabric = torch.tensor([order.index(name) for name in self._rows], device=device)

        def stacked(columns: Iterable[Float32]) -> Tensor:
            return torch.from_numpy(np.stack([column[:each] for column in columns])).to(device)

        rows = self._rows.values()
        query = {name: stacked(getattr(queries, name) for queries, _ in rows) for name in Queries._fields}
        target = stacked(answers.mean for _, answers in rows)
        transparency = stacked(answers.transparency for _, answers in rows)
        return Batch(fabric, **query, target=target, transparency=transparency)

    def error_and_noise(self, weights: dict[str, Tensor]) -> tuple[float, float]:
        """Return the mean squared error over all components, as measured, and the truth's own; not without queries."""
        sums = np.zeros(2)
        for _, prediction, _, answers in self._answered(weights, self._look):
            sums += [np.square(prediction - answers.mean).mean(), np.square(answers.standard_error).mean()]
        error, noise = (sums / len(self._rows)).tolist()
        return error, noise

    def figures(self, weights: dict[str, Tensor]) -> dict[str, Any]:
        """Return ``{fabric: {component: figures, "footprints": {bin: {component: figures}}}}``."""
        found: dict[str, Any] = {}
        for name, prediction, queries, answers in self._answered(weights, self._share):
            place = np.digitize(np.minimum(queries.sigma, queries.sigma_minor), FOOTPRINTS)
            bins = {}
            for number, label in enumerate(footprint_labels()):
                inside = place == number
                if inside.any():
                    bins[label] = _component_figures(prediction[inside], answers.take(inside))
            found[name] = _component_figures(prediction, answers) | {"footprints": bins}
        return found

    def _answered(self, weights: dict[str, Tensor], share: int) -> Iterator[tuple[str, Float32, Queries, Answers]]:
        (method,) = restore_methods(self._options, [(self._card, weights)])
        for name, (queries, answers) in self._rows.items():
            few = queries.take(slice(share))
            yield name, method.predict(self._manifest.fabrics[name], few), few, answers.take(slice(share))


def footprint_labels() -> list[str]:
    """Name the bins of footprints."""
    inner = [f"{low:g} to {high:g}" for low, high in itertools.pairwise(FOOTPRINTS)]
    return [f"below {FOOTPRINTS[0]:g}", *inner, f"above {FOOTPRINTS[-1]:g}"]


def _component_figures(prediction: Float32, answers: Answers) -> dict[str, dict[str, float]]:
    """Compare components (N, 4) with the truth; ``noise`` is its mean squared standard error."""
    truth = answers.mean.astype(np.float64)
    mse = np.square(prediction - truth).mean(axis=0)
    noise = np.square(answers.standard_error.astype(np.float64)).mean(axis=0)
    mean = truth.mean(axis=0)
    relative = np.sqrt(mse) / np.maximum(mean, np.finfo(np.float64).tiny)
    columns = {"mse": mse, "noise": noise, "mean": mean, "relative_rmse": relative}
    return {
        component: {name: float(f"{column[index]:.6g}") for name, column in columns.items()}
        for index, component in enumerate(COMPONENTS)
    }
