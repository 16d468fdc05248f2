"""Measurement: a task of the benchmark, its Records and its pictures."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Final, Self

from jobs.plan.measurements.subjects import Subjects, Trained
from jobs.plan.task import Made, Progress, Stage, Task
from pipeline import versions
from pipeline.models.added.added_code import AddedMethod
from reports import catalogue
from reports.catalogue import AddedMetric
from reports.options import RunOptions
from reports.page.content import PictureFile
from weaves.fabric import Fabric

if TYPE_CHECKING:
    from reports.record import Record

_SUBJECTS: Final = ("study", "metric", "model", "fabric", "scene")  # what is measured, in the order of a title


class Measurement(Task):
    """A task of the benchmark; each kind has a field ``kind``, the method `planned`, and `measure` or `run`."""

    stage: ClassVar[Stage] = "bench"
    code: ClassVar[tuple[str, ...]] = ("bench",)
    """Its code among `pipeline.versions` and ``bench``, beside that of its models and of their ways to run."""
    endings: ClassVar[tuple[str, ...]] = ()
    """Of the files of a kind that makes files for others, not Records: pictures of the truth, for example."""

    kind: str  # name of the kind of measurement

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield all measurements of this kind that a recipe has."""
        raise NotImplementedError

    @property
    def subjects(self) -> tuple[str, ...]:
        """Names of the measured model with its seed, fabric, view or scene."""
        values = (getattr(self, name, None) for name in _SUBJECTS)
        return tuple(_label(value) for value in values if value is not None)

    @property
    def title(self) -> str:
        """Kind and subjects."""
        return f"{self.kind} of {', '.join(self.subjects)}" if self.subjects else self.kind

    @property
    def group(self) -> str:
        """Kind."""
        return self.kind

    @property
    def stem(self) -> str:
        """Path of its files without their endings."""
        words = re.sub(r"[^A-Za-z0-9_.]+", "-", "-".join((self.kind, *self.subjects)))
        return f"records/{words}-{self.id[:8]}"

    @property
    def records(self) -> str:
        """File of its Records; empty if it has none."""
        return "" if self.endings else f"{self.stem}.json"

    @property
    def pictures(self) -> tuple[PictureFile, ...]:
        """Pictures that it writes, relative to the output folder."""
        return ()

    @property
    def products(self) -> tuple[str, ...]:
        """Files that others read; or Records, the machine they were measured on, pictures."""
        if self.endings:
            return tuple(f"{self.stem}{ending}" for ending in self.endings)
        return (self.records, f"{self.stem}.machine.json", *(str(picture.path) for picture in self.pictures))

    @property
    def made(self) -> Made:
        """The file that other measurements read."""
        return Made(task=self.id, path=self.products[0])

    @property
    def threads(self) -> int:
        """Most threads that a method may use while it is measured."""
        return 1

    def picture(self, setting: str, view: str = "") -> Path:
        """Return the path of the picture of a setting."""
        return Path("-".join(filter(None, (self.stem, setting.replace(" = ", ""), view))) + ".exr")

    def versions(self) -> dict[str, int]:
        """Return the versions of its code, of its models, and of ways to run them; its inputs have their own."""
        code, options = {*self.code}, [model.options for model in self.held(Trained)]
        code |= {"bound"} if any(way.bounds for way in self.held(RunOptions)) else set()
        code |= {"fallback"} if any(model.model == "selvage" for model in options) else set()
        models = {model.name: model.version for model in options}
        numbers = {**vars(versions), "BENCH": catalogue.BENCH}
        return {name: numbers[name.upper()] for name in code} | models

    def without(self, names: Sequence[str]) -> Self | None:
        """Return the measurement without some methods from outside; None if it measures one model alone."""
        models: tuple[Trained, ...] | None = getattr(self, "models", None)
        left = models and tuple(model for model in models if model.options.name not in names)
        return None if left is None else self.model_copy(update={"models": left})

    def run(self, out: Path, progress: Progress) -> None:
        """Measure, and write the Records; with code from outside, in a process that can be ended.

        A method that fails ends a measurement of it alone. One of several methods starts again without it. MethodFailed
        if the only method fails.
        """
        models = (model.options for model in self.held(Trained))
        added = [*self.held(AddedMetric), *(options for options in models if isinstance(options, AddedMethod))]
        if not added:
            self.write(out, {}, progress)
            return
        from pipeline.models.added.apart import run_apart
        from pipeline.models.added.guarded import MethodFailed

        left_out: dict[str, str] = {}
        while True:
            try:
                return run_apart(self.write, out, left_out, limits=added, progress=progress)
            except MethodFailed as failure:
                if failure.name in left_out or self.without([failure.name]) is None:
                    raise
                left_out[failure.name] = failure.reason

    def write(self, out: Path, left_out: Mapping[str, str], progress: Progress) -> None:
        """Measure, and write the Records; `left_out` has the methods from outside that failed here, with reasons."""
        from reports.record import Record, this_machine, write_records

        measured = self.without(list(left_out)) if left_out else self
        assert measured is not None
        records = [self._stamped(record) for record in measured.measure(out, progress)]
        records += [
            Record(method=name, scene=getattr(self, "scene", ""), metric="not_run", value=1.0, note=reason)
            for name, reason in left_out.items()
        ]
        models = [model.options for model in self.held(Trained)]
        origins = {options.name: options.origin for options in models if isinstance(options, AddedMethod)}
        records = [record.made_by(origins[record.method]) if record.method in origins else record for record in records]
        write_records(out / self.records, records, this_machine(self.threads))

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Return the Records, without what is common to all of them; pictures are written."""
        raise NotImplementedError

    def _stamped(self, record: Record) -> Record:
        """Return a Record with its data set and training, and the role of the fabric where all have the same."""
        from reports.record import Provenance

        dataset, model = getattr(self, "dataset", None), getattr(self, "model", None)
        trained = {"model": " ".join(model.needs), "seed": model.seed} if model else {}
        about = Provenance(dataset=dataset.fingerprint if dataset else "", origin=record.provenance.origin, **trained)
        return record.model_copy(update={"provenance": about, "role": getattr(self, "role", record.role)})


def _label(subject: object) -> str:
    if isinstance(subject, Trained):
        return subject.title
    return subject.name if isinstance(subject, Fabric | AddedMetric) else str(subject)
