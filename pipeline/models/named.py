"""Methods by the names that people give on a command line.

`soft_nodes` is a model that learns nothing, `point_sampled:16` or `selvage:.02` one with a setting, and
`out/models/NAME` the folder of a trained one. Without a setting a model's usual one is taken, or the last, which is the
most accurate.
"""

from pipeline.models.card import CARD
from pipeline.models.catalogue import CLASSES
from pipeline.models.domain import Domain
from pipeline.models.fallback import Fallback
from pipeline.models.method import Method
from pipeline.models.options import Options
from pipeline.models.registry import load_methods, load_model, model_folder
from pipeline.storage import place
from weaves.errors import BadInput
from weaves.validation import validated

TRUTH = "truth"  # name of the ground truth among methods


def untrained_names() -> list[str]:
    """Return the names of the models that learn nothing."""
    return sorted(name for name, options in CLASSES.items() if not options.learns)


def named_method(name: str, where: str, key: str) -> Fallback:
    """Return a method that answers any query; others than its own go to the fallback. As `loaded` otherwise."""
    return Fallback(*loaded(name, where, key, TRUTH))


def loaded(name: str, where: str, key: str, *others: str) -> tuple[Method, frozenset[str]]:
    """Return a method that answers queries of its own kinds, and these kinds.

    `name` is that of a model that learns nothing, with ``:k`` for a setting, or the folder of a trained one. For
    messages, `where` and `key` are the verb or function and its option that name it, `others` are further names that
    they list. BadInput if there is no such method,
    it must be trained first, it has no such setting, or its files are damaged.
    """
    model, _, setting = name.partition(":")
    if model in untrained_names():
        options = _with_setting(CLASSES[model](), setting, where, key, name)
        return load_methods(options)[-1], options.kinds
    if name in CLASSES and not (place(name, key) / CARD).is_file():
        raise BadInput(where, key, name, "must be trained first: name the folder of a trained one, out/models/…")
    (method,) = load_model(model_folder(name, where, key, [*others, *untrained_names()]))
    domain: Domain | None = getattr(method, "domain", None)
    return method, domain.kinds if domain else frozenset()


def _with_setting(options: Options, setting: str, where: str, key: str, name: str) -> Options:
    """Return options with the one setting that is named, or the usual one."""
    if not setting and options.usual_setting is None:
        return options
    if not options.parameter:
        raise BadInput(where, key, name, f"{options.model} has no settings")
    try:
        chosen = options.read_setting(setting) if setting else options.usual_setting
        return validated(type(options), {options.parameter: [chosen]}, where)
    except BadInput as error:
        raise BadInput(where, key, name, error.allowed) from error
    except ValueError as error:
        raise BadInput(where, key, name, options.settings_allowed) from error
