"""Trained models for `twillight evaluate --model`: by name, for those of the package, or by folder."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from pipeline.models.registry import covering_model, model_folder
from pipeline.shards.evaluate import Answerer
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric
from weaves.reading import MIB, read_text


def refuse_truth_options(chosen: Mapping[str, object]) -> None:
    """Refuse options of the truth, which a model does not have."""
    for name, value in chosen.items():
        if value is not None:
            allowed = "leave it out with --model: it is an option of the ground truth"
            raise BadInput("evaluate", f"--{name.replace('_', '-')}", value, allowed)


def answerer(model: str, fabric: Fabric, extrapolate: bool) -> Answerer:
    """Return a trained model, prepared for a fabric.

    Parameters
    ----------
    model : str
        Name of one that comes with the package, or path of a folder with ``model.safetensors`` and ``card.json``.
    fabric : Fabric
        The fabric of the queries.
    extrapolate : bool
        Accept yarns outside the training domain.

    Raises
    ------
    BadInput
        If there is no such model, its files are damaged, or it does not cover the fabric.
    """
    method = covering_model(model, fabric, "evaluate", "--model")
    domain = getattr(method, "domain", None)
    if domain is not None and not extrapolate:
        domain.refuse_fabric(fabric, method.name)
    method.prepare(fabric)
    through: Any = getattr(method, "transparency", None)

    def answer(queries: Queries) -> tuple[np.typing.NDArray[np.float32], np.typing.NDArray[np.float32]]:
        shares = through(fabric, queries) if through else np.zeros(len(queries.u), np.float32)
        return method.predict(fabric, queries), shares

    folder = model_folder(model, "evaluate", "--model")
    about = {"model": method.name, "card": read_text(folder / "card.json", 8 * MIB, "a model card")}
    if domain is None:
        return Answerer(answer, about)
    return Answerer(answer, about, lambda queries: domain.faults(queries, method.name))
