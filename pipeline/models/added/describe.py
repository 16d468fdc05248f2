"""Description of a method or metric from outside, read from its code in a process of its own."""

import inspect
import json
import re
from collections.abc import Callable, Mapping
from typing import Any, Final, get_args

from pipeline.models.added.added_code import AddedFunction, AddedMethod, CallLimits, Kind
from pipeline.models.added.apart import run_apart
from pipeline.models.added.guarded import MethodFailed, faults_of
from pipeline.models.added.source import ADD, locate
from weaves.errors import BadInput, brief, nearest
from weaves.validation import validated

_LOADING: Final = 60.0  # seconds that importing a method's code, and making the method, may take
_FUNCTIONS: Final = ("covers", "prepare", "predict", "bytes_stored")  # of `pipeline.models.method.Method`
_TRAINED: Final = ("network", "load")  # functions of methods whose network is trained
_STATED: Final = ("name", "setting", "version")  # attributes that every method has
_MAY_STATE: Final = ("kinds", "of_one_material")  # attributes that may be missing

# The cloth, N queries about it, the method's answers, the truth's and their errors, (N, 4).
_METRIC_PARAMETERS: Final = ("fabric", "queries", "answers", "truth", "standard_error")

# Attributes that a metric may have, with their defaults.
_OF_METRICS: Final = {"title": "", "unit": "1", "better": "lower", "format": "significant"}

_NAME: Final = re.compile(r"[A-Za-z0-9_-]{1,60}")
_SETTING: Final = re.compile(r"[\w .,=+%()-]{0,40}")  # it becomes part of file names and of tables in Markdown


def describe(text: str, own: Mapping[str, Any], more: Mapping[str, Any]) -> AddedMethod | AddedFunction:
    """Return what code from outside is: a function is a metric, a class a method.

    `text` is ``module:name`` or ``file.py:name``; `own` are the method's own options, others have their defaults;
    `more` are the name in tables, if it is not the method's own, and the limits of time and memory. BadInput if there
    is no such code, it cannot be imported, the method cannot be made, or it lacks what a method needs.
    """
    try:
        json.dumps(own)
    except TypeError as error:
        raise BadInput(ADD, "", text, f"its options must be numbers, texts, lists and tables ({error})") from error
    try:
        limits = validated(CallLimits, {key: more[key] for key in CallLimits.model_fields if key in more}, ADD)
        fields = run_apart(_described, text, dict(own), limits=[limits])
    except MethodFailed as failure:
        raise BadInput(ADD, "", text, failure.reason) from failure
    fields |= more
    return validated(AddedMethod, fields, ADD) if "own" in fields else validated(AddedFunction, fields, ADD)


def _described(text: str, own: dict[str, Any], progress: Callable[[float], None]) -> dict[str, Any]:
    """Return the fields of the options; runs in a process of its own."""
    source = locate(text)
    sha256 = source.sha256()
    with faults_of(source.name, "import", _LOADING, source.root):
        module = source.imported()
    make = source.of(module)
    code = {"source": source.text, "folder": source.folder, "sha256": sha256, "distribution": source.distribution()}
    if inspect.isfunction(make):
        return {**_stated_by_function(make, text), **code}
    if not callable(make):
        raise BadInput(ADD, "", text, "is no class of a method and no function of a metric")
    _check_options(make, own, text)
    with faults_of(source.name, "__init__", _LOADING, source.root):
        method = make(**own)
    with faults_of(source.name, "its attributes", _LOADING, source.root):
        names = (*_STATED, *_MAY_STATE, *_FUNCTIONS, *_TRAINED)
        has = {name: getattr(method, name) for name in names if hasattr(method, name)}
        if not isinstance(has.get("kinds", ""), str):
            has["kinds"] = list(has["kinds"])
    return {**_stated(has, text), **code, "own": own}


def _stated_by_function(function: Callable[..., Any], text: str) -> dict[str, Any]:
    """Return what a metric says of itself: its name, its docstring, and its attributes."""
    if len(inspect.signature(function).parameters) != len(_METRIC_PARAMETERS):
        raise BadInput(ADD, "", text, f"a metric is a function of {', '.join(_METRIC_PARAMETERS)}")
    definition = " ".join((inspect.getdoc(function) or "").partition("\n\n")[0].split())
    if not definition:
        raise BadInput(ADD, "", text, "lacks a docstring, which defines the metric on the page")
    stated = {key: getattr(function, key, default) for key, default in _OF_METRICS.items()}
    name, version = function.__name__, str(getattr(function, "version", 1))
    stated["title"] = stated["title"] or name.replace("_", " ")
    return {**stated, "stated": version, "name": name, "definition": definition}


def _check_options(make: Callable[..., Any], own: Mapping[str, Any], text: str) -> None:
    """Refuse options that the method does not take, or a method that needs more."""
    try:
        parameters = inspect.signature(make).parameters.values()
    except (TypeError, ValueError):
        return  # compiled code may have no signature
    named = [p for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)]
    names = [p.name for p in named]
    if not any(p.kind == p.VAR_KEYWORD for p in parameters):
        for key in own:
            if key not in names:
                known = nearest(key, names) if names else "it has no options"
                raise BadInput(ADD, "", text, f"has no option {brief(key)}; {known}")
    for parameter in named:
        if parameter.default is parameter.empty and parameter.name not in own:
            raise BadInput(ADD, "", text, f"its option {parameter.name!r} has no default; every option needs one")


def _stated(has: Mapping[str, Any], text: str) -> dict[str, Any]:
    """Return what a method says of itself, from its attributes; BadInput if one is missing or cannot be used."""
    if lacks := [name for name in _FUNCTIONS if not callable(has.get(name))]:
        raise BadInput(ADD, "", text, f"lacks the function {lacks[0]!r} of pipeline.models.method.Method")
    if lacks := [name for name in _STATED if name not in has]:
        raise BadInput(ADD, "", text, f"lacks the attribute {lacks[0]!r}")
    name, setting, version = has["name"], has["setting"], has["version"]
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise BadInput(ADD, "", text, f"name = {brief(name)} must be letters, digits, - and _, 60 at most")
    if not isinstance(setting, str) or not _SETTING.fullmatch(setting):
        allowed = "must be at most 40 letters, digits, spaces and . , = + - % ( )"
        raise BadInput(ADD, "", text, f"setting = {brief(setting)} {allowed}")
    if isinstance(version, bool) or not isinstance(version, int | str) or not 0 < len(str(version)) <= 64:
        raise BadInput(ADD, "", text, f"version = {brief(version)} must be an integer or a short text")
    kinds, known = has.get("kinds", []), get_args(Kind)
    if isinstance(kinds, str) or not all(kind in known for kind in kinds):
        raise BadInput(ADD, "", text, f"kinds = {brief(kinds)} must be some of {', '.join(known)}")
    learns, one_fabric = callable(has.get("network")), has.get("of_one_material", False)
    if learns and not callable(has.get("load")):
        raise BadInput(ADD, "", text, "has a function 'network' and lacks 'load', which receives the trained network")
    if not isinstance(one_fabric, bool):
        raise BadInput(ADD, "", text, f"of_one_material = {brief(one_fabric)} must be True or False")
    if one_fabric and not learns:
        raise BadInput(ADD, "", text, "has of_one_material = True and lacks a function 'network', which is trained")
    stated = {"name": name, "setting": setting, "stated": str(version), "answers": sorted(kinds)}
    return stated | {"has_network": learns, "has_one_fabric": one_fabric}
