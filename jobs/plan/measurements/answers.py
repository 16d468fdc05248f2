"""Errors of answers that were handed in, on the held-out queries of all fabrics, and what their form states."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tomli_w

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import HeldOutRows, Subjects
from jobs.plan.task import Coloured, Place, Progress
from jobs.recipe.entry import ANSWER_FILES, FORM, EntryForm
from pipeline.atomic import atomic_write
from reports.options import ErrorOptions, Role, select
from weaves.errors import BadInput

if TYPE_CHECKING:
    from reports.record import Record


class OfAnswers(Measurement):
    """The answers of an entry; a copy of it lies beside its Records, so that these can be made again."""

    kind: Literal["answers"] = "answers"
    form: EntryForm
    sha256: str
    fabrics: tuple[tuple[Coloured, Role], ...]  # all fabrics, in the order of the questions
    named: int  # number of fabrics that the recipe names, the first ones; the others are random
    dataset: HeldOutRows
    errors: ErrorOptions
    file: Place

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one an entry."""
        recipe = subjects.recipe
        for entry in recipe.entries:
            yield cls(
                form=entry.form,
                sha256=entry.sha256,
                fabrics=recipe.tested,
                named=len(subjects.fabrics),
                dataset=subjects.held_out(*(fabric for fabric, _ in recipe.tested)),
                errors=select(ErrorOptions, recipe.bench),
                file=entry.answers,
            )

    @property
    def subjects(self) -> tuple[str, ...]:
        """Name of the entry."""
        return (self.form.name,)

    @property
    def stem(self) -> str:
        """Path of its Records without the ending, in a folder of its own."""
        return f"entries/{self.form.name}-{self.id[:8]}/records"

    @property
    def products(self) -> tuple[str, ...]:
        """Records, the machine, and a copy of the entry."""
        folder = self.stem.removesuffix("records")
        return (*super().products, folder + FORM, folder + ANSWER_FILES[0])

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure the answers, and copy the entry; BadInput if they are no longer those that were planned."""
        from pipeline.shards.entry_files import answers_sha256, read_answers, write_answers
        from reports.measure.answers import measure_answers
        from reports.record import Record

        rows = list(self.dataset.read(out, [fabric.name for fabric, _ in self.fabrics]))
        answers = read_answers(Path(self.file), sum(len(part.queries.u) for part in rows))
        if answers_sha256(answers) != self.sha256:
            raise BadInput(self.file, "", "was changed after the plan was made", "start the command again")
        form, subject = self.form, Record(method=self.form.name).made_by(f"{self.form.about}, SHA-256 {self.sha256}")
        records = measure_answers(subject, answers, rows, [role for _, role in self.fabrics], self.named, self.errors)
        for metric, value, note in form.costs:
            records.append(subject.of(metric, value, 1).model_copy(update={"note": note}))
        *_, form_copy, answers_copy = self.products
        atomic_write(out / form_copy, tomli_w.dumps(form.model_dump()).encode())
        write_answers(out / answers_copy, answers)
        return records
