"""Reading and validation of TOML files: each error is one sentence.

`read_toml` reads a file, `validated` builds a pydantic model from its content. Both raise `BadInput` only; its sentence
names file, dotted key, value and what is allowed.
"""

from __future__ import annotations

import reprlib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from weaves.errors import BadInput, nearest
from weaves.renamed import KEY, replacement

Model = TypeVar("Model", bound=BaseModel)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    BadInput
        If the file is missing, unreadable, not UTF-8, or not TOML (naming the line).
    """
    where = _clean(str(path))
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise BadInput(where, "", "no such file", "the path of a TOML file is needed") from error
    except OSError as error:
        raise BadInput(where, "", error.strerror or "not readable", "a TOML file that can be read is needed") from error
    except UnicodeDecodeError as error:
        raise BadInput(where, "", f"byte {error.start} is not UTF-8", "TOML files are UTF-8 text") from error
    except RecursionError as error:
        raise BadInput(where, "", "nested too deeply", "a fabric or recipe needs three levels") from error
    except ValueError as error:  # TOMLDecodeError, numbers of absurd length, zero bytes in the path
        raise BadInput(where, "", "broken TOML", _clean(str(error))) from error


def validated(model: type[Model], data: Mapping[str, Any], where: str) -> Model:
    """Build `model` from `data`.

    Parameters
    ----------
    model : type of pydantic model
        Class of the result.
    data : mapping
        Content of the file.
    where : str
        The file, for messages.

    Raises
    ------
    BadInput
        For the first error; the sentence counts the others.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise bad_input(error, model, data, where) from error


def bad_input(error: ValidationError, model: type[BaseModel], data: object, where: str) -> BadInput:
    """Turn a pydantic error into one sentence."""
    # Unknown keys first: a misspelt key also makes the right one missing, and the former message is more useful.
    errors = sorted(error.errors(include_url=False), key=lambda item: item["type"] != "extra_forbidden")
    first = errors[0]
    more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    location, value = first["loc"], _brief(first["input"])
    key = ".".join(_path(location, data, keep_last=first["type"] in {"missing", "extra_forbidden"}))
    match first["type"]:
        case "missing":
            return BadInput(where, "", f"{_clean(key)} is missing", f"it is required{more}")
        case "extra_forbidden":
            allowed = "unknown key; " + nearest(str(location[-1]), _fields_at(model, location[:-1]), KEY)
        case "union_tag_invalid":
            context = first["ctx"]
            discriminator = context["discriminator"].strip("'")
            key, value = f"{key}.{discriminator}", _brief(context["tag"])
            allowed = nearest(
                context["tag"], [name.strip(" '") for name in context["expected_tags"].split(",")], discriminator
            )
        case "union_tag_not_found":
            discriminator = first["ctx"]["discriminator"].strip("'")
            return BadInput(where, "", f"{_clean(key)}.{discriminator} is missing", f"it is required{more}")
        case "literal_error" if new := replacement(str(location[-1]), first["input"]):
            allowed = new
        case "model_type" | "model_attributes_type" | "dict_type":
            allowed = "a table is needed"
        case _:
            allowed = first["msg"].removeprefix("Value error, ")
            cause = first.get("ctx", {}).get("error")
            if isinstance(cause, BadInput):
                # A rule of the weave (such as the moves of a satin) names its own key below this one.
                key, value, allowed = ".".join(filter(None, (key, cause.key))), cause.value, cause.allowed
    if not key:
        return BadInput(where, "", f"found {value!r}", allowed + more)
    return BadInput(where, _clean(key), value, allowed + more)


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
        inner = [
            found for known in models if step in known.model_fields for found in _models(known.model_fields[str(step)])
        ]
        # A step that is no field is an index (stay) or the tag of a union (choose).
        models = inner or [known for known in models if _tagged(known, step)] or models
    return {name for known in models for name in known.model_fields}


def _models(field: Any) -> list[type[BaseModel]]:
    """Return the models inside an annotation, at any depth."""
    annotation = getattr(field, "annotation", field)
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for part in get_args(annotation) for found in _models(part)]


def _tagged(model: type[BaseModel], tag: int | str) -> bool:
    return any(tag in get_args(field.annotation) for field in model.model_fields.values())


def _brief(value: object) -> object:
    """Shorten a value whose repr would fill the terminal."""
    shown = reprlib.repr(value)
    return value if shown == repr(value) and len(shown) <= 80 else _clean(str(value))


def _clean(text: str) -> str:
    """Return a text as one line of at most 200 characters."""
    line = "".join(letter if letter.isprintable() else "·" for letter in text)
    return line if len(line) <= 200 else f"{line[:200]}…"
