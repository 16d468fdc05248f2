"""Task: one piece of work, with everything it depends on as typed fields.

A task is known by what it computes: its id is the fingerprint of its stage and its identity. The identity is the task's
own dump, with the versions of the code at work and without the fields that say where files lie (`Place`). So the same
work is the same task in another recipe, in another order or on more workers.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal, TypeVar

from pydantic import BaseModel, SerializationInfo, SerializerFunctionWrapHandler, WrapSerializer, model_serializer

from pipeline.fingerprint import IDENTITY, fingerprint
from weaves.fabric import Fabric
from weaves.validation import Frozen

_Kind = TypeVar("_Kind")

Stage = Literal["generate", "train", "bench", "report"]

STAGES: Final[tuple[Stage, ...]] = ("generate", "train", "bench", "report")
"""The stages in the order of work; each is a verb of the command line."""

Progress = Callable[[float], None]  # function that receives the finished share of a task

PLACE: Final = "place"
"""Marks a field that only says where things lie: `Annotated[..., PLACE]`. It is no part of an identity."""

Place = Annotated[str, PLACE]  # a path relative to the output folder, or a name that a recipe gives
Places = Annotated[tuple[str, ...], PLACE]  # several of them


class TaskPart(Frozen):
    """A part of a task: typed fields, without its places in an identity."""

    @model_serializer(mode="wrap")
    def _without_places(self, dump: SerializerFunctionWrapHandler, info: SerializationInfo) -> dict[str, Any]:
        content: dict[str, Any] = dump(self)
        if info.context == IDENTITY:
            for name, field in type(self).model_fields.items():
                if PLACE in field.metadata:
                    del content[name]
        return content

    @property
    def needs(self) -> tuple[str, ...]:
        """Ids of the tasks whose products it reads: those of its parts."""
        return tuple(id for part in self.held(TaskPart) for id in part.needs)

    def held(self, kind: type[_Kind]) -> Iterator[_Kind]:
        """Yield all objects of a kind in its fields, but none inside another one."""
        for name in type(self).model_fields:
            yield from _held_in(getattr(self, name), kind)


class Made(TaskPart):
    """Products of another task that this one reads."""

    task: str
    path: Place  # path of its product, or of the folder of its products

    @property
    def needs(self) -> tuple[str, ...]:
        """That task."""
        return (self.task,)


class Task(TaskPart):
    """A piece of work; the methods that raise NotImplementedError are each kind's to define."""

    stage: ClassVar[Stage]
    shares_process: ClassVar[bool] = False
    """True if it may run beside others in one process: it uses no random numbers and threads of a library."""
    timed: ClassVar[bool] = False

    @property
    def group(self) -> str:
        """Name of the tasks of its kind, for people."""
        raise NotImplementedError

    @property
    def title(self) -> str:
        """Name of this one."""
        raise NotImplementedError

    @property
    def products(self) -> tuple[str, ...]:
        """Files that exist when it is done, relative to the output folder."""
        raise NotImplementedError

    def written(self, out: Path) -> tuple[str, ...]:
        """Return all files that it has made in the output folder `out`: the products, last, and what they list."""
        return self.products

    @property
    def slots(self) -> Literal["one", "all"]:
        """Slots of a run that it takes: all if it measures time, so nothing runs beside it and its process is new."""
        return "all" if self.timed else "one"

    @property
    def cost(self) -> float:
        """Estimated seconds on one core of a desktop of 2023; a run corrects them by the tasks that have ended."""
        return 1.0

    @property
    def rows(self) -> int:
        """Estimated rows of the products."""
        return 0

    def versions(self) -> dict[str, int]:
        """Return the version of every piece of code that the result depends on (`pipeline.versions`)."""
        raise NotImplementedError

    def identity(self) -> dict[str, Any]:
        """Return everything that the products' bytes depend on, JSON-able."""
        return {"versions": self.versions(), **self.model_dump(mode="json", context=IDENTITY)}

    @cached_property
    def id(self) -> str:
        """Fingerprint of the stage and the identity: 16 hexadecimal digits."""
        return fingerprint([self.stage, self.identity()])

    def run(self, out: Path, progress: Progress) -> None:
        """Do the work in a worker process; the products then lie in `out`. Heavy libraries are imported here."""
        raise NotImplementedError


def _optics(fabric: Fabric, dump: SerializerFunctionWrapHandler, info: SerializationInfo) -> Any:
    """Return the fabric; in an identity its optics, and its name, which seeds random points."""
    return {"name": fabric.name, "optics": fabric.optics()} if info.context == IDENTITY else dump(fabric)


def _look(fabric: Fabric, dump: SerializerFunctionWrapHandler, info: SerializationInfo) -> Any:
    """Return the fabric; in an identity its optics, its colours and its name."""
    if info.context != IDENTITY:
        return dump(fabric)
    shown = {"specular", "diffuse", "diffuse_transmission"}
    colours = fabric.model_dump(mode="json", include={"warp": shown, "weft": shown, "colours": True})
    return {"name": fabric.name, "optics": fabric.optics(), "colours": colours}


Uncoloured = Annotated[Fabric, WrapSerializer(_optics)]  # a fabric whose colours do not change the result
Coloured = Annotated[Fabric, WrapSerializer(_look)]  # a fabric whose colours change the result


def _held_in(value: object, kind: type[_Kind]) -> Iterator[_Kind]:
    if isinstance(value, kind):
        yield value
        return
    if isinstance(value, BaseModel):
        value = [getattr(value, name) for name in type(value).model_fields]
    if isinstance(value, Mapping | list | tuple):
        for inner in value.values() if isinstance(value, Mapping) else value:
            yield from _held_in(inner, kind)
