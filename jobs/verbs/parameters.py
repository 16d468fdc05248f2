"""Parameters that several verbs have on the command line."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from cyclopts import Parameter, Token

from jobs.run.cluster import HERE, Scheduler
from weaves.errors import BadInput, one_line


def _place(type_: object, tokens: Sequence[Token]) -> Path:
    from pipeline.storage import place

    return place(tokens[0].value, tokens[0].keyword or "")


def _local(type_: object, tokens: Sequence[Token]) -> Path:
    path = _place(type_, tokens)
    if not isinstance(path, Path):
        raise ValueError(f"{one_line(tokens[0].value, 80)} is an address; a path of this machine is needed here")
    return path


def _added(type_: object, tokens: Sequence[Token]) -> list[str]:
    """Return what is added; of the folder of an entry the path of its form."""
    from jobs.recipe.entry import FORM

    return [str(Path(each.value) / FORM) if each.keyword == "--answers" else each.value for each in tokens]


@contextmanager
def named_flags(verb: str, where: str, **flags: str) -> Iterator[None]:
    """Name options in the messages of `where` as the verb does, as flags; `flags` are those that differ."""
    try:
        yield
    except BadInput as error:
        if error.where != where:
            raise
        name = flags.get(error.key, error.key).replace("_", "-")
        raise BadInput(verb, name and f"--{name}", error.value, error.allowed) from error


def given(flags: Any) -> dict[str, Any]:
    """Return the fields of a dataclass of flags that are given, not None."""
    return {name: value for name, value in asdict(flags).items() if value is not None}


FabricName = Annotated[str, Parameter(help="Name of a preset, or path of a .toml file.")]
RecipeName = Annotated[str, Parameter(help="Name of a recipe of the package, or path of a .toml file.")]
SceneName = Annotated[str, Parameter(help="Name of a scene of the package, or path of an .xml or .toml file.")]
Add = Annotated[
    list[str],
    Parameter(
        name=("--add", "--answers"),
        converter=_added,
        help="Method or metric from outside: MODULE:NAME, FILE.py:NAME, or an installed method; runs its code. "
        "--answers: the folder of an entry, with answers to the recipe's questions; runs no code.",
    ),
]
NOTHING: Final[list[str]] = []

Local = Annotated[Path, Parameter(converter=_local)]  # a path of this machine
Whole = Annotated[int, Parameter(converter=lambda _, tokens: int(tokens[0].value))]  # cyclopts rounds 1.5 to 2
Place = Annotated[Any, Parameter(converter=_place)]
"""A path; `Any`, because one of object storage is no `pathlib.Path` to pydantic, which cyclopts may call."""
Out = Annotated[Place, Parameter(help="Folder of all products, or an address such as s3://bucket/x.")]

OUT: Final = Path("out")


@dataclass(frozen=True)
class WorkerFlags:
    """Processes that do the tasks, and how their progress is shown."""

    workers: Annotated[Whole, Parameter(help="Worker processes on this machine, one thread each; 0: one per core.")] = 0
    scheduler: Annotated[Scheduler, Parameter(name="*")] = HERE
    progress: Annotated[
        Literal["auto", "rich", "plain", "json"],
        Parameter(help="Progress as bars, as lines of a log, or as JSON lines; auto: bars on a terminal, else lines."),
    ] = "auto"


On = Annotated[WorkerFlags, Parameter(name="*")]
ON: Final = WorkerFlags()
