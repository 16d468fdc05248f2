"""Models by name and from folders; a model's file is imported when it is needed.

The options of a model that learns nothing make its methods. For one that learns, `model.py` beside its options has the
functions ``restore(options, trained) -> list of Method`` and ``build(options, fabrics, *extra) -> Trainable``, where
`trained` pairs each model card with its weights. `extra` is one list for each set that ``options.extra_rows`` declares:
the columns of its rows, fabric by fabric.
"""

from collections.abc import Iterable, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import safetensors.torch
from pydantic import BaseModel
from safetensors import SafetensorError
from torch import Tensor

from pipeline.fingerprint import IDENTITY
from pipeline.models.added.added_code import ADDED_MODEL, AddedMethod
from pipeline.models.analytic.adapter import AnalyticOptions
from pipeline.models.card import CARD, WEIGHTS, read_card, read_weights
from pipeline.models.catalogue import CLASSES, ModelOptions
from pipeline.models.method import Method
from pipeline.models.network import Trained
from pipeline.storage import place
from weaves.errors import BadInput, WorkFailed, nearest
from weaves.fabric import Fabric
from weaves.validation import validated


class _Card(BaseModel):
    """The part of a model card that names the model."""

    options: ModelOptions


def module_of(model: str) -> ModuleType:
    """Import the file of a model; BadInput, with the nearest name, if there is none."""
    if model not in CLASSES:
        raise BadInput("models", "model", model, nearest(model, CLASSES))
    return import_module(f"{CLASSES[model].__module__}.model")


def model_folder(model: str, where: str, key: str, others: Iterable[str]) -> Path:
    """Return the folder of a trained model, with ``model.safetensors`` and ``card.json``; BadInput if it is none.

    `where` and `key` are the function or verb and its argument that name the model, `others` names that are allowed
    there too, for messages.
    """
    folder = place(model, key)
    if not (folder / CARD).is_file():
        allowed = f"the folder of a trained model or a name is needed; {nearest(model, others)}"
        raise BadInput(where, key, model, allowed)
    return folder


def build_network(options: ModelOptions, fabrics: Sequence[Fabric], extra: Iterable[Any] = ()) -> Any:
    """Return an untrained `pipeline.models.network.Trainable` of a design that learns; one material learns one fabric.

    MethodFailed if the code of a network from outside is not the planned one, or fails.
    """
    if isinstance(options, AddedMethod):
        from pipeline.models.added.network import build_added

        return build_added(options, fabrics)
    return module_of(options.model).build(options, fabrics, *extra)


def restore_methods(options: ModelOptions, trained: Trained) -> list[Method]:
    """Return the methods that options and trained models describe; RuntimeError or KeyError if they do not fit."""
    if isinstance(options, AddedMethod):
        if options.learns:
            from pipeline.models.added.network import restore_added

            return [restore_added(options, trained)]
        from pipeline.models.added.guarded import load_added

        return [load_added(options)]
    if isinstance(options, AnalyticOptions):
        return list(options.methods())
    return list(module_of(options.model).restore(options, trained))


def load_methods(options: ModelOptions, folders: Sequence[Path] = ()) -> list[Method]:
    """Return the methods that options describe: one; for `point_sampled` one a number of points.

    `folders` hold trained models of this very design: one for `woven`, one a fabric for `neumip`, none for
    `point_sampled`. BadInput if one holds no model, a damaged one, or one of another design or version; MethodFailed if
    the code of a method from outside is not the planned one, or fails.
    """
    trained = [_read(folder, options) for folder in folders]
    try:
        return restore_methods(options, trained)
    except (BadInput, WorkFailed):
        raise
    except (RuntimeError, KeyError, ValueError) as error:
        where, allowed = ", ".join(map(str, folders)), "card and weights do not fit together: train it again"
        raise BadInput(where, "", "not a whole model", allowed) from error


def load_model(folder: Path) -> list[Method]:
    """Return the methods of one trained folder, options read from its card."""
    card = read_card(folder)
    if isinstance(about := card.get("options"), dict) and about.get("model") == ADDED_MODEL:
        allowed = "is a network from outside the package, whose code is not here: measure it with --add"
        raise BadInput(str(folder / CARD), "name", card.get("name"), allowed)
    return load_methods(validated(_Card, card, str(folder / CARD)).options, [folder])


def _read(folder: Path, options: Any) -> tuple[dict[str, Any], dict[str, Tensor]]:
    card = read_card(folder)
    if card.get("options") != options.model_dump(mode="json", context=IDENTITY):
        raise BadInput(str(folder / CARD), "options", card.get("options"), "trained with other options; train it again")
    version = card.get("version", {}).get("model")
    if version != options.version:
        allowed = f"this is version {options.version} of {options.model}: train it again"
        raise BadInput(str(folder / CARD), "version", version, allowed)
    try:
        return card, safetensors.torch.load(read_weights(folder, card))
    except SafetensorError as error:
        raise BadInput(str(folder / WEIGHTS), "", "not a file of weights", "train the model again") from error
