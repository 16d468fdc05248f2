"""Methods, metrics and answers from outside in a recipe: given with `--add`, or installed and named by the recipe.

A recipe names such a method as it names any other, ``[[models]] model = "its_name"``; the keys beside are its options.
`--add` enters it with its defaults if the recipe does not name it. A function is a metric, which is measured of
all methods. A recipe alone never runs code.
"""

from collections.abc import Mapping, Sequence
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Final

from jobs.recipe.entry import FORM
from pipeline.models.added.added_code import ADDED_MODEL, GROUP, AddedFunction, AddedMethod, CallLimits
from pipeline.models.added.describe import describe
from pipeline.models.added.source import ADD
from pipeline.models.catalogue import CLASSES, REPLACED_MODELS
from reports.catalogue import AddedMetric
from weaves.errors import BadInput, nearest
from weaves.validation import validated

_BESIDE: Final = ("model", "name", "version", "limit", "memory", "training", "seeds", "runtimes")  # no options


class Added:
    """The methods from outside that a recipe may name, by the values of `--add`.

    A value is ``module:name``, ``file.py:name``, the name of an installed method, or the path of an entry's form, which
    the command line makes of ``--answers FOLDER``. BadInput if one cannot be used, is given twice, or has the name of a
    method of the package.
    """

    def __init__(self, given: Sequence[str] = ()) -> None:
        self._given: dict[str, AddedMethod] = {}
        self.metrics: list[AddedMetric] = []  # the metrics from outside
        self.forms = [Path(text) for text in given if text.endswith(FORM)]  # the forms of entries
        for text in (text for text in given if not text.endswith(FORM)):
            source = text if ":" in text else _installed().get(text)
            if source is None:
                known = f"installed: {', '.join(sorted(_installed()))}" if _installed() else "none is installed"
                raise BadInput(ADD, "", text, f"no method of this name; {known}; MODULE:NAME or FILE.py:NAME?")
            method = describe(source, {}, {})
            if isinstance(method, AddedFunction):
                metric = validated(AddedMetric, method.model_dump(), text)
                if metric.name in [known.name for known in self.metrics]:
                    raise BadInput(ADD, "", text, f"a metric {metric.name!r} is given twice")
                self.metrics.append(metric)
                continue
            if method.name in CLASSES or method.name == ADDED_MODEL:
                raise BadInput(ADD, "", text, f"its name {method.name!r} is that of a method of the package")
            if method.name in self._given:
                raise BadInput(ADD, "", text, f"a method {method.name!r} is given twice")
            self._given[method.name] = method

    def entered(self, entries: Sequence[Any], where: str, all_given: bool) -> list[Any]:
        """Return the models of a recipe's file; those from outside have all that the code says of them.

        With `all_given` the methods of `--add` that it does not name are entered too. BadInput if an entry names a
        method that is neither of the package, nor given, nor installed, or that cannot be used.
        """
        models = [self._entry(entry, f"models.{index}", where) for index, entry in enumerate(entries)]
        if all_given:
            named = [entry.get("model", entry.get("name")) for entry in entries if isinstance(entry, Mapping)]
            models += [method.model_dump() for name, method in self._given.items() if name not in named]
        return models

    def model_of(self, method: AddedMethod) -> str:
        """Return the value of `model` by which a recipe names a method: the name that its code states."""
        stated = {given.source: name for name, given in self._given.items()}
        return stated.get(method.source) or {source: name for name, source in _installed().items()}[method.source]

    def _entry(self, entry: Any, key: str, where: str) -> Any:
        """Return an entry of a recipe's models, written out if the method is from outside."""
        if not isinstance(entry, Mapping) or not isinstance(model := entry.get("model"), str) or model in CLASSES:
            return entry
        if "recipe" in entry:
            return entry  # it is written out in that recipe (`jobs.recipe.trained_by`)
        given, installed = self._given.get(model), _installed().get(model)
        if given is None and installed is None:
            known = nearest(model, [*CLASSES, *self._given, *_installed()])
            allowed = f"code of your own is given with --add FILE.py:CLASS; {known}"
            if model in REPLACED_MODELS:
                allowed = f"this method is gone: take {REPLACED_MODELS[model]!r}"
            raise BadInput(where, f"{key}.model", model, allowed)
        own = {name: value for name, value in entry.items() if name not in _BESIDE}
        name = entry.get("name", model)
        limits = {key: entry[key] for key in CallLimits.model_fields if key in entry}
        source = given.source if given else str(installed)
        method = describe(source, own, {"name": name, **limits})
        if isinstance(method, AddedFunction):
            raise BadInput(where, f"{key}.model", model, "is the entry point of a metric; a method is needed")
        if "version" in entry and str(entry["version"]) != method.stated:
            raise BadInput(where, f"{key}.version", entry["version"], f"the method given has version {method.stated}")
        rest = {name: entry[name] for name in ("training", "seeds", "runtimes") if name in entry}
        return method.model_dump() | rest


def _installed() -> dict[str, str]:
    """Return the methods of installed packages: their source by name."""
    return {entry.name: entry.value.replace(" ", "") for entry in entry_points(group=GROUP)}
