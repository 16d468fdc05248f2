"""Record: one measured number and where it comes from; as JSON files, and as a pandas table.

A file ``NAME.json`` holds the records of one task and nothing that differs between two runs of the same work, so that
its bytes are a function of the work (times excepted, which are what they are). The machine, the versions of the
packages and the date lie beside it in ``NAME.machine.json``, written first: records exist only together with it. It
also has a hash over both files, so that damaged Records are never read.
"""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import pandas as pd
from pydantic import AfterValidator, FailFast, Field, TypeAdapter, ValidationError

from pipeline.atomic import atomic_write
from pipeline.cores import cores
from pipeline.fingerprint import file_sha256
from reports.catalogue import ADDED, BENCH, METRICS, metric_row
from reports.error import Error
from reports.options import Role
from weaves.errors import BadInput
from weaves.reading import MIB, read_json
from weaves.validation import Frozen

PACKAGES: Final = (
    "numpy", "scipy", "numba", "torch", "onnxruntime", "pyarrow", "pandas", "OpenEXR", "matplotlib", "scikit-image",
    "flip-evaluator", "colour-science",
)  # fmt: skip
"""Packages whose versions are noted."""

TRUTH: Final = "truth"  # name of the reference, where methods are named

OF_A_PAGE: Final = "records.json"
"""File in a page's folder that holds all its Records; the machine of the times lies beside it."""


def _known(metric: str) -> str:
    """Return a metric of the catalogue; ValueError if there is no such row."""
    if metric not in METRICS and not metric.startswith(ADDED):
        raise ValueError(f"{metric!r} is no metric of reports.catalogue")
    return metric


Metric = Annotated[str, AfterValidator(_known)]  # name of a metric, a key of `reports.catalogue.METRICS`


class Provenance(Frozen):
    """Subject of a measurement: names and fingerprints common to a task's records."""

    recipe: str = ""
    recipe_fingerprint: str = ""
    dataset: str = ""  # fingerprint of the data set
    model: str = ""  # fingerprint of the trained model; empty where nothing is trained
    seed: int = 0  # of its training
    origin: str = ""
    """Of a method or metric from outside: distribution or file, its version, and the SHA-256 of its code."""
    machine: str = ""  # where Records of several are in one file (`reports.machines`)
    version: int = BENCH  # of the measurements


class Record(Frozen):
    """One measurement."""

    method: str
    """Name of the method as the recipe names it; ``truth`` for the reference itself."""
    setting: str = ""
    """Variant of the method, such as ``k = 2``."""
    fabric: str = ""
    """Empty where several are meant together."""
    role: Role | Literal[""] = ""
    scene: str = ""
    """`queries`: held-out queries; otherwise the view of a fabric, or, where no fabric is named, the scene."""
    metric: Metric = "mse"
    value: float = 0.0
    """The number, in `unit`; the median for times."""
    standard_error: float | None = None
    low: float | None = None
    """Lower end of the 95 % interval; the first quartile for times."""
    high: float | None = None
    """Upper end of the 95 % interval; the third quartile for times."""
    count: int = 1
    """Queries, pixels, frames or repeats behind it."""
    unit: str = "1"
    curve: Annotated[tuple[tuple[float, float], ...], FailFast()] = ()
    """Points of a curve, where one number does not say it all."""
    threads: int = 0
    """Threads that worked at the same time; 0 where it does not matter."""
    samples: Annotated[tuple[float, ...], FailFast()] = ()
    """Every reading behind a time, in `unit`, in the order they were taken."""
    note: str = ""
    """Further information on `value`, such as the input that gave it."""
    provenance: Provenance = Provenance()

    def of(self, metric: Metric, value: float, count: int, **bounds: Any) -> Record:
        """Return another number measured on the same subject, in the unit of its metric.

        Its `bounds` are `standard_error`, `low`, `high`, `curve` and `samples`; those of this Record do not count.
        """
        subject = self.model_dump(exclude={"standard_error", "low", "high", "curve", "samples"})
        number = {"metric": metric, "value": value, "count": count, "unit": metric_row(metric).unit}
        return Record.model_validate(subject | number | bounds)

    def subject(self, *provenance: str) -> tuple[object, ...]:
        """Return what the number is of, with these fields of its provenance."""
        own = (self.method, self.setting, self.fabric, self.role, self.scene, self.metric, self.threads, self.note)
        return (*own, *(getattr(self.provenance, name) for name in provenance))

    def made_by(self, origin: str) -> Record:
        """Return the Record with the origin of a method or metric from outside the package."""
        origins = "; ".join(filter(None, (self.provenance.origin, origin)))
        return self.model_copy(update={"provenance": self.provenance.model_copy(update={"origin": origins})})

    def of_error(self, error: Error) -> list[Record]:
        """Return the three numbers of a mean squared error."""
        e = error
        return [
            self.of("mse", e.value, e.count, standard_error=e.standard_error, low=e.low, high=e.high),
            self.of("mse_measured", e.measured, e.count),
            self.of("truth_noise", e.noise, e.count),
        ]


_MOST_BYTES: Final = 32 * MIB  # of a file of records: those of the largest number have about 320 bytes each
_RECORDS: Final = TypeAdapter(Annotated[list[Record], Field(max_length=100_000), FailFast()])


class Machine(Frozen):
    """Where and when it was measured."""

    cpu: str  # model of the processor
    cores: int  # that this process may use
    threads: int  # that a method could use
    system: str  # operating system and architecture
    python: str  # version
    packages: dict[str, str]  # versions
    date: str  # UTC, ISO 8601
    sha256: str = ""
    """Hash over the Records beside it and over the other fields; in files of earlier versions there is none."""

    def beside(self, records: str) -> Machine:
        """Return the machine with the hash over the SHA-256 of Records and over its other fields."""
        own = self.model_dump_json(exclude={"sha256"})
        return self.model_copy(update={"sha256": hashlib.sha256((records + own).encode()).hexdigest()})

    def encoded(self) -> bytes:
        """Return the bytes of its file."""
        return self.model_dump_json(indent=1, exclude_unset=True).encode() + b"\n"


def this_machine(threads: int) -> Machine:
    """Describe the machine this runs on; `threads` is what methods were allowed."""
    packages = {}
    for name in PACKAGES:
        with suppress(PackageNotFoundError):
            packages[name] = version(name)
    return Machine(
        cpu=_cpu(),
        cores=cores(),
        threads=threads,
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
        packages=packages,
        date=datetime.now(UTC).isoformat(timespec="seconds"),
    )


def write_records(path: Path, records: Sequence[Record], machine: Machine) -> None:
    """Write a task's records to `path` (``NAME.json``) and the machine beside it.

    Of each record what differs from the defaults, and always the metric and the value.
    """
    rows = ({"metric": r.metric, "value": r.value, **r.model_dump(mode="json", exclude_defaults=True)} for r in records)
    lines = ",\n".join(map(json.dumps, rows))
    content = f"[\n{lines}\n]\n".encode()
    atomic_write(machine_path(path), machine.beside(hashlib.sha256(content).hexdigest()).encoded())
    atomic_write(path, content)


def machine_path(path: Path) -> Path:
    """Return the file that holds the machine of the records in `path`."""
    return path.with_name(f"{path.stem}.machine.json")


def read_records(paths: Iterable[Path]) -> list[Record]:
    """Read records from files, in the order of the files; BadInput names the first that is damaged or holds none."""
    records: list[Record] = []
    for path in paths:
        try:
            content = read_json(path, _MOST_BYTES, "a file of records")
            if machine_path(path).exists():
                read_machine(path)
            records += _RECORDS.validate_python(content)
        except FileNotFoundError as error:
            raise BadInput(str(path), "", "does not exist", "records are needed; run the benchmark first") from error
        except ValidationError as error:
            fault = error.errors(include_url=False)[0]
            where = ".".join(map(str, fault["loc"]))
            why = fault["msg"].removeprefix("Value error, ")
            fault_words = f"holds no records of this version ({where}: {why})" if where else "holds no records"
            raise BadInput(str(path), "", fault_words, "run the benchmark again") from error
    return records


def read_machine(path: Path) -> Machine:
    """Read the machine of the records in `path`; BadInput if it is missing, or one of both files is damaged."""
    beside = machine_path(path)
    try:
        machine = Machine.model_validate(read_json(beside, MIB, "a file of one machine"))
        whole = beside.read_bytes() == machine.encoded() and machine == machine.beside(file_sha256(path))
    except (OSError, ValidationError) as error:
        raise BadInput(str(beside), "", "missing or damaged", "run the benchmark again") from error
    if "sha256" in machine.model_fields_set and not whole:
        raise BadInput(str(path), "", f"damaged, or {beside.name} is: hashes differ", "run the benchmark again")
    return machine


def to_table(records: Iterable[Record]) -> pd.DataFrame:
    """Return one row a record, provenance as columns of its own, curves and samples left out."""
    left_out = {"curve", "samples", "provenance"}
    rows = [record.model_dump(exclude=left_out) | record.provenance.model_dump() for record in records]
    columns = [name for name in Record.model_fields if name not in left_out]
    table = pd.DataFrame(rows, columns=[*columns, *Provenance.model_fields])
    return table.astype({"standard_error": "float64", "low": "float64", "high": "float64"})


def _cpu() -> str:
    """Return the processor's model name, as Linux reports it."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.is_file() else []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()
