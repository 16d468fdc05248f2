"""Entries: answers to the questions of a recipe that were computed elsewhere, with a form about them.

The questions are the held-out queries of all measured fabrics, numbered fabric by fabric. No code of an entrant runs:
what the form states is shown as stated.
"""

import textwrap
from pathlib import Path
from typing import Annotated, Final, NamedTuple

from pydantic import AfterValidator, Field, StrictBool, StrictInt

from weaves.errors import BadInput
from weaves.validation import FileName, Frozen, read_toml, validated

FORM: Final = "entry.toml"  # file of the form
ANSWER_FILES: Final = ("answers.parquet", "answers.csv")  # files of the answers, of which one lies beside the form


def is_plain(text: str) -> bool:
    """Return whether Markdown and HTML show a text as it is, on one line."""
    return text.isprintable() and not set(text) & set("|`<>[]\\")


def _shown(text: str) -> str:
    if not is_plain(text):
        raise ValueError("one line without | ` < > [ ] \\ is needed")
    return text


Text = Annotated[str, Field(max_length=200), AfterValidator(_shown)]
Filled = Annotated[Text, Field(min_length=1)]
Number = Annotated[StrictInt, Field(ge=0, lt=2**63)]


class EntryForm(Frozen):
    """A form, as the entrant filled it in."""

    questions: str = Field(pattern=r"^[0-9a-f]{16}$", description="The questions that are answered. Leave it.")
    name: FileName = Field(description="Name in tables and files: letters, digits, - and _, at most 60.")
    authors: Filled = Field(description="Who made the method: one line of at most 200 letters.")
    source: Text = Field(description="Address of the code. Empty: the result is marked as one without code.")
    version: Filled = Field(
        description="Commit, or SHA-256, of the code and weights that answered, frozen before the questions were known."
    )
    nanoseconds: float = Field(gt=0, le=1e15, description="Time of one query: that of all answers over their number.")
    threads: StrictInt = Field(ge=1, le=10**6, description="Threads that worked in that time, at least 1.")
    machine: Filled = Field(description="Processor or GPU that the time is of: one line of at most 200 letters.")
    bytes_stored: Number = Field(
        description="Bytes that are stored for one fabric: weights, textures, tables; mean over fabrics."
    )
    multiply_adds: Number = Field(
        description="Multiplications with additions of one query, mean over the questions; a division, a root or an "
        "exponential counts as one."
    )
    training: Filled = Field(description="Data that it was trained on, with the number of rows; none if it was not.")
    each_fabric: StrictBool = Field(description="true if every fabric, the unseen ones too, was trained on by itself.")
    tries: StrictInt = Field(
        ge=1, le=10**6, description="How many answers of yours to these questions were measured, these included."
    )

    @property
    def about(self) -> str:
        """Origin in words."""
        return f"answers by {self.authors}, version {self.version}, {self.code}; its costs are stated, not measured"

    @property
    def costs(self) -> tuple[tuple[str, float, str], ...]:
        """Metric, value and note of each number that is stated."""
        return (
            ("stated_time", self.nanoseconds, f"{self.machine}, threads: {self.threads}"),
            ("stated_bytes", self.bytes_stored, self.training),
            ("stated_multiply_adds", self.multiply_adds, ""),
            ("stated_tries", self.tries, f"{self.code}, version {self.version}"),
        )

    @property
    def code(self) -> str:
        """Address of the code, or that there is none."""
        return self.source or "without code"


class Entry(NamedTuple):
    """A form, and the answers beside it by their hash (`pipeline.shards.entry_files`) and their absolute path."""

    form: EntryForm
    sha256: str
    answers: str


def blank_form(questions: str) -> str:
    """Return the form to fill in, each field below what is allowed; as it is, it is refused."""
    lines = [f"# Form of an entry: fill it in and hand it in beside {' or '.join(ANSWER_FILES)}."]
    for name, field in EntryForm.model_fields.items():
        blank = '""' if field.annotation is str else "false" if field.annotation is bool else "-1"
        value = f'"{questions}"' if name == "questions" else blank
        lines += ["", *textwrap.wrap(f"# {field.description}", 118, subsequent_indent="# "), f"{name} = {value}"]
    return "\n".join(lines) + "\n"


def read_entry(path: Path, questions: str, count: int) -> Entry:
    """Read the form at a path and the answers beside it, to so many questions of a fingerprint.

    BadInput if it is of other questions, or anything in it, or in the answers, cannot be used.
    """
    from pipeline.shards.entry_files import answers_sha256, read_answers

    form = validated(EntryForm, read_toml(path), str(path))
    if form.questions != questions:
        raise BadInput(str(path), "questions", form.questions, f"those of this recipe and version are {questions}")
    files = [file for name in ANSWER_FILES if (file := path.absolute().with_name(name)).exists()]
    if len(files) != 1:
        both = " and ".join(ANSWER_FILES)
        raise BadInput(str(path.parent), "", f"holds {both}" if files else f"lacks {both}", "one of them is needed")
    return Entry(form, answers_sha256(read_answers(files[0], count)), str(files[0]))
