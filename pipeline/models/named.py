"""Methods by the names that people give on a command line.

`selvage` is a model that comes with the package, `out/models/NAME` the folder of a trained one, `soft_nodes` a model
that learns nothing, and `point_sampled:16` one of its settings. Without a setting the last one is taken, which is the
most accurate. `selvage:.02` is that model at a wished relative error.
"""

from __future__ import annotations

from pipeline.models.card import CARD
from pipeline.models.catalogue import CLASSES
from pipeline.models.fallback import Fallback
from pipeline.models.method import Method
from pipeline.models.options import Options
from pipeline.models.registry import load_methods, load_model, model_folder, pretrained_names
from pipeline.models.selvage.model import Selvage
from pipeline.storage import place
from weaves.errors import BadInput
from weaves.validation import validated

TRUTH = "truth"
"""Name of the ground truth among methods."""


def untrained_names() -> list[str]:
    """Return the names of the models that learn nothing."""
    return sorted(name for name, options in CLASSES.items() if not options.learns)


def named_method(name: str, where: str, key: str) -> Fallback:
    """Return a method that answers any query; others than its own go to the fallback. As `own_method` otherwise."""
    return Fallback(*_loaded(name, where, key))


def own_method(name: str, where: str, key: str) -> Method:
    """Return a method that answers queries of its own kinds.

    Parameters
    ----------
    name : str
        Name of a model that comes with the package or learns nothing, with ``:k`` for a setting or ``:.02`` for a
        wished error, or a folder.
    where, key : str
        The verb or function and its option that name the method, for messages.

    Raises
    ------
    BadInput
        If there is no such method, it must be trained first, it has no such setting, or its files are damaged.
    """
    return _loaded(name, where, key)[0]


def _loaded(name: str, where: str, key: str) -> tuple[Method, frozenset[str]]:
    """Return a method and the kinds of queries that it knows."""
    model, _, setting = name.partition(":")
    if model in untrained_names():
        options = _with_setting(CLASSES[model](), setting, where, key, name)
        return load_methods(options)[-1], options.kinds
    if model in pretrained_names() and setting:
        (trained,) = load_model(model_folder(model, where, key))
        if not isinstance(trained, Selvage):
            raise BadInput(where, key, name, f"{model} has no settings")
        try:
            chosen = trained.within(float(setting))
        except ValueError as error:
            allowed = "a relative error above 0 and below 1 after the colon is needed, such as :.02"
            raise BadInput(where, key, name, allowed) from error
        return chosen, _kinds(chosen)
    if name in CLASSES and name not in pretrained_names() and not (place(name, key) / CARD).is_file():
        raise BadInput(where, key, name, "must be trained first: name the folder of a trained one, out/models/…")
    (method,) = load_model(model_folder(name, where, key, [TRUTH, *untrained_names()]))
    return method, _kinds(method)


def _with_setting(options: Options, setting: str, where: str, key: str, name: str) -> Options:
    """Return options with one setting k, if one is named."""
    if not setting:
        return options
    if not options.parameter or not setting.isdecimal() or len(setting) > 6:
        allowed = f"a number k after the colon is needed, such as {options.model}:4"
        raise BadInput(where, key, name, allowed if options.parameter else f"{options.model} has no settings")
    try:
        return validated(type(options), {options.parameter: [int(setting)]}, where)
    except BadInput as error:
        raise BadInput(where, key, name, error.allowed) from error


def _kinds(method: object) -> frozenset[str]:
    """Return the kinds of queries that a trained method knows."""
    domain = getattr(method, "domain", None)
    trained: frozenset[str] = frozenset() if domain is None else domain.kinds
    return trained | frozenset(getattr(method, "without_training", ()))
