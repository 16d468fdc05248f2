"""The models that exist: every folder beside this file that has a network, and every file of `analytic`.

Options are data: they enter the fingerprint of a trained model, and a recipe's ``[[models]]`` table is validated by
`ModelOptions`, the union distinguished by ``model``. Nothing heavy is imported here, so that plans can be made without
torch. A new model is a new file or folder; nothing else names it. Methods from outside the package are one more member
of the union, `AddedMethod`.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Final, Union

from pydantic import Field

from pipeline.models.added.added_code import AddedMethod
from pipeline.models.options import Options


def _options_of(module: ModuleType) -> dict[str, type[Options]]:
    """Return the options' classes that a module defines, by the model that they are of."""
    members = [member for member in vars(module).values() if isinstance(member, type) and issubclass(member, Options)]
    own = [member for member in members if member.__module__ == module.__name__]
    models = {member.model_fields["model"].default: member for member in own}
    return {model: member for model, member in models.items() if model}


def _modules() -> Iterator[str]:
    """Yield the names of modules with the options of a model."""
    here = Path(__file__).parent
    yield from (f"analytic.{path.stem}" for path in here.glob("analytic/*.py"))
    yield from (path.parent.name for path in here.glob("*/model.py"))


CLASSES: dict[str, type[Options]] = {
    model: options
    for name in sorted(_modules(), key=lambda name: name.rpartition(".")[2])
    for model, options in _options_of(import_module(f"pipeline.models.{name}")).items()
}
"""The options' class of every model of the package, by its name."""

REPLACED_MODELS: Final = {"gauss_nodes": "soft_nodes", "summed_area": "soft_nodes"}
"""Models of earlier versions, and those to take in their place."""

if TYPE_CHECKING:
    ModelOptions = Options
else:
    ModelOptions = Annotated[Union[(*CLASSES.values(), AddedMethod)], Field(discriminator="model")]
"""Any model's options, distinguished by `model`."""
