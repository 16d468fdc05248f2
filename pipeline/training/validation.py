"""Figures on held-out queries for the model card, each beside the noise of the truth it was measured against.

A mean squared error against a noisy truth is the model's own plus the noise, the mean squared standard error: both
are on the card.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from torch import Tensor

from pipeline.models.registry import module_of
from pipeline.shards.manifest import Manifest
from pipeline.training.options import TrainingOptions
from pipeline.truth.frames import COMPONENTS
from pipeline.truth.query import Answers


def validation_figures(
    options: Any,
    card: dict[str, Any],
    weights: dict[str, Tensor],
    manifest: Manifest,
    folder: Path,
    training: TrainingOptions,
) -> dict[str, Any]:
    """Return ``{fabric: {component: figures}}`` for the trained fabrics that have validation rows."""
    (method,) = module_of(options.model).restore(options, [(card, weights)])
    held_out = {shard.fabric for shard in manifest.shards if shard.split == "validation"}
    names = [entry["name"] for entry in card["fabrics"] if entry["name"] in held_out]
    figures = {}
    for name in names:
        queries, answers = manifest.read(folder, name, "validation")
        share = slice(max(training.validation_rows // len(names), 1))
        prediction = method.predict(manifest.fabrics[name], queries.take(share))
        figures[name] = component_figures(prediction, answers.take(share))
    return figures


def component_figures(prediction: npt.NDArray[np.float32], answers: Answers) -> dict[str, dict[str, float]]:
    """Compare components (N, 4) with the truth.

    Returns
    -------
    dict
        For each component: ``mse``, ``noise`` (the truth's mean squared standard error), ``mean`` of the truth, and
        ``relative_rmse``, sqrt(mse) / mean.
    """
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
