"""The models that exist: every folder beside this file that has options.

Options are data: they enter the fingerprint of a trained model, and a recipe's ``[[models]]`` table is validated by
`ModelOptions`, the union distinguished by ``model``. Nothing heavy is imported here, so that plans can be made without
torch. A new model is a new folder; nothing else names it. Methods from outside the package are one more member of the
union, `AddedMethod`.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Union, cast

from pydantic import Field

from pipeline.models.added.added_method import AddedMethod
from pipeline.models.options import Options


def _options_of(model: str) -> type[Options]:
    """Return the options' class of a model: the one in its folder whose field ``model`` is the folder's name."""
    module = import_module(f"pipeline.models.{model}.options")
    members: list[Any] = list(vars(module).values())
    for found in members:
        fields = found.model_fields if isinstance(found, type) and issubclass(found, Options) else {}
        if "model" in fields and fields["model"].default == model:
            return cast(type[Options], found)
    raise TypeError(f"{module.__file__} defines no options whose field model is {model!r}")


CLASSES: dict[str, type[Options]] = {
    folder.parent.name: _options_of(folder.parent.name) for folder in sorted(Path(__file__).parent.glob("*/options.py"))
}
"""The options' class of every model of the package, by the name of its folder."""

REPLACED: Final = {"gauss_nodes": "soft_nodes"}
"""Models of earlier versions, and those to take in their place."""

if TYPE_CHECKING:
    ModelOptions = Options
else:
    ModelOptions = Annotated[Union[(*CLASSES.values(), AddedMethod)], Field(discriminator="model")]
"""Any model's options, distinguished by `model`."""
