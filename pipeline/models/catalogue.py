"""The models that exist: every folder beside this file that has a network, and every file of `analytic`.

A new model is a new file or folder; nothing else names it. A recipe's ``[[models]]`` table is validated by
`ModelOptions`, of which methods from outside the package, `AddedMethod`, are one more member. Nothing heavy is imported
here, so that plans can be made without torch.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Union

from pydantic import Field

from pipeline.models.added.added_code import AddedMethod
from pipeline.models.options import Options


def _options() -> Iterator[tuple[str, type[Options]]]:
    """Yield the models and the classes of their options, in the order of the names of their modules."""
    here = Path(__file__).parent
    names = [f"analytic.{path.stem}" for path in here.glob("analytic/*.py")]
    names += [path.parent.name for path in here.glob("*/model.py")]
    for name in sorted(names, key=lambda name: name.rpartition(".")[2]):
        module = import_module(f"pipeline.models.{name}")
        classes = [value for value in vars(module).values() if isinstance(value, type) and issubclass(value, Options)]
        own = [options for options in classes if options.__module__ == module.__name__]
        yield from ((model, options) for options in own if (model := options.model_fields["model"].default))


CLASSES: dict[str, type[Options]] = dict(_options())  # the options' class of every model of the package, by its name

REPLACED_MODELS: Final = {"gauss_nodes": "soft_nodes", "summed_area": "soft_nodes"}
"""Models of earlier versions, and those to take in their place."""

if TYPE_CHECKING:
    ModelOptions = Options
else:
    ModelOptions = Annotated[Union[(*CLASSES.values(), AddedMethod)], Field(discriminator="model")]
"""Any model's options, distinguished by `model`."""
