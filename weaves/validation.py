"""Reading and validation of TOML files: each error is one sentence.

`read_toml` reads a file, `validated` builds a pydantic model from its content. Both raise `BadInput` only; its sentence
names file, dotted key, value and what is allowed.
"""

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from weaves.errors import BadInput, brief, nearest, one_line
from weaves.reading import MOST_TEXT, read_text

Model = TypeVar("Model", bound=BaseModel)

MOST_DEPTH: Final = 16  # most tables and lists inside one another; recipes have five

# A key of more parts, joined by dots: tomllib takes their number squared in time and memory. Bounded repetitions, and
# none that goes back, keep the search itself linear.
_PART = r"""(?:(?<![\w-])[\w-]++|"(?:\\.|[^"\\\n]){0,99}+"|'[^'\n]{0,99}+')"""
_LONG_KEY = re.compile(rf"(?:{_PART}[ \t]{{0,99}}+\.[ \t]{{0,99}}+){{{MOST_DEPTH}}}")


def _file_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,60}", name):
        raise ValueError("a name has 1 to 60 letters (without accents), digits, - and _")
    return name


FileName = Annotated[str, AfterValidator(_file_name)]
"""A name that becomes part of file names."""


class Frozen(BaseModel):
    """Data from outside or for an identity: fixed, without other keys, every number finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    also_read: ClassVar[tuple[str, ...]] = ()  # keys that a file may have in place of fields


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; BadInput if it is missing, irregular, larger than `MOST_TEXT`, no UTF-8, or as `parse_toml`."""
    try:
        text = read_text(path, MOST_TEXT, "a TOML file")
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "no such file", "the path of a TOML file is needed") from error
    return parse_toml(text, str(path))


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """Return the content of a TOML text of bounded length.

    BadInput if it is no TOML (naming the line), nested more deeply than `MOST_DEPTH`, or has integers beyond 64 bits.
    """
    allowed = f"at most {MOST_DEPTH} levels are allowed"
    if _LONG_KEY.search(text):
        raise BadInput(where, "", "nested too deeply", allowed)
    try:
        content = tomllib.loads(text)
    except RecursionError as error:
        raise BadInput(where, "", "nested too deeply", allowed) from error
    except ValueError as error:  # TOMLDecodeError, numbers of absurd length
        raise BadInput(where, "", "broken TOML", one_line(error)) from error
    level, depth = list[Any]([content]), 0
    while level:
        if bits := next((one.bit_length() for one in level if isinstance(one, int) and one.bit_length() > 64), 0):
            raise BadInput(where, "", f"an integer of {bits:,} bits", "TOML has integers of 64 bits")
        inside = [one.values() if isinstance(one, dict) else one for one in level if isinstance(one, dict | list)]
        level, depth = [item for items in inside for item in items], depth + bool(inside)
        if depth > MOST_DEPTH:
            raise BadInput(where, "", "nested too deeply", allowed)
    return content


def validated(model: type[Model], data: Mapping[str, Any], where: str) -> Model:
    """Build a model from the content of the file `where`; BadInput for the first error, which counts the others."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise _bad_input(error, model, data, where) from error


def _bad_input(error: ValidationError, model: type[BaseModel], data: object, where: str) -> BadInput:
    # Unknown keys first: a misspelt key also makes the right one missing, and the former message is more useful.
    errors = sorted(error.errors(include_url=False), key=lambda item: item["type"] != "extra_forbidden")
    first = errors[0]
    more = f" (one of {len(errors)} errors)" if len(errors) > 1 else ""
    location, value = first["loc"], first["input"]
    key = ".".join(_path(location, data, keep_last=first["type"] in {"missing", "extra_forbidden"}))
    match first["type"]:
        case "missing":
            return BadInput(where, "", f"{key} is missing", f"it is required{more}")
        case "extra_forbidden":
            allowed = "unknown key; " + nearest(str(location[-1]), _fields_at(model, location[:-1]))
        case "union_tag_invalid":
            context = first["ctx"]
            discriminator = context["discriminator"].strip("'")
            key, value = f"{key}.{discriminator}", context["tag"]
            allowed = nearest(context["tag"], [name.strip(" '") for name in context["expected_tags"].split(",")])
        case "union_tag_not_found":
            discriminator = first["ctx"]["discriminator"].strip("'")
            return BadInput(where, "", f"{key}.{discriminator} is missing", f"it is required{more}")
        case "model_type" | "model_attributes_type" | "dict_type":
            allowed = "a table is needed"
        case _:
            allowed = first["msg"].removeprefix("Value error, ")
            cause = first.get("ctx", {}).get("error")
            if isinstance(cause, BadInput):
                # A rule of the weave (such as the moves of a satin) names its own key below this one.
                key, value, allowed = ".".join(filter(None, (key, cause.key))), cause.value, cause.allowed
    if not key:
        return BadInput(where, "", f"found {brief(value)}", allowed + more)
    return BadInput(where, key, value, allowed + more)


def _path(location: Sequence[int | str], data: object, *, keep_last: bool) -> list[str]:
    """Return the part of pydantic's location that is in the data; it also contains names of union members."""
    path: list[str] = []
    for depth, step in enumerate(location):
        inside = range(len(data)) if isinstance(data, list | tuple) else data
        if isinstance(inside, Mapping | range) and step in inside:
            data = data[step]  # type: ignore[index]
        elif not (keep_last and depth == len(location) - 1):
            continue
        path.append(str(step))
    return path


def _fields_at(model: type[BaseModel], location: Sequence[int | str]) -> set[str]:
    """Return the names of the fields that the models at `location` know."""
    models = [model]
    for step in location:
        fields = [known.model_fields[str(step)] for known in models if step in known.model_fields]
        inner = [model for field in fields for model in _models(field)]
        tagged = [known for known in models if any(step in get_args(f.annotation) for f in known.model_fields.values())]
        models = inner or tagged or models  # a step that is no field is the tag of a union (choose) or an index (stay)
    return {name for known in models for name in (*known.model_fields, *getattr(known, "also_read", ()))}


def _models(field: Any) -> list[type[BaseModel]]:
    """Return the models inside an annotation, at any depth."""
    annotation = getattr(field, "annotation", field)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for part in get_args(annotation) for found in _models(part)]
