"""Records of several machines in one file.

Numbers that a machine decides (times, rates, memory: `of_machine` of `reports.catalogue.MetricRow`) are kept of each
machine, whose name is then part of their provenance. Other numbers are kept once where all machines have the same one.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from reports.catalogue import metric_row
from reports.record import Machine, Record
from weaves.errors import BadInput


class Joined(NamedTuple):
    """Records of several machines."""

    records: list[Record]
    shared: int  # numbers that several machines have alike, and that are kept once
    unlike: list[tuple[Record, Record]]  # pairs of one number that two machines have differently; both are kept


def names_of(machines: Sequence[Machine]) -> list[str]:
    """Return a name for each machine; those of equal machines end in their number."""
    names = []
    for m in machines:
        threads = f"{m.threads} thread{'' if m.threads == 1 else 's'}"
        names.append(f"{m.cpu}, {m.cores} cores, {threads}, {m.system}")
    return [f"{name} ({names[:i].count(name) + 1})" if names.count(name) > 1 else name for i, name in enumerate(names)]


def join(parts: Mapping[str, Sequence[Record]]) -> Joined:
    """Join the Records of machines, given by the names of the machines.

    BadInput if Records of one machine hold several machines already.
    """
    records: list[Record] = []
    known: dict[tuple[object, ...], Record] = {}
    shared, unlike = 0, []
    for name, part in parts.items():
        refuse_several(part, name)
        for record in part:
            own = record.model_copy(update={"provenance": record.provenance.model_copy(update={"machine": name})})
            if metric_row(record.metric).of_machine:
                records.append(own)
                continue
            subject = record.subject("dataset", "model", "seed", "origin", "version")  # whatever the recipe is called
            first = known.setdefault(subject, record)
            if first is record:
                records.append(record)
            elif _number(first) == _number(record):
                shared += 1
            else:
                records.append(own)
                unlike.append((first, record))
    return Joined(records, shared, unlike)


def refuse_several(records: Sequence[Record], where: str) -> None:
    """Raise BadInput if Records hold the numbers of several machines."""
    if any(record.provenance.machine for record in records):
        raise BadInput(where, "", "holds Records of several machines", "the Records of one machine are needed")


def _number(record: Record) -> tuple[object, ...]:
    return record.value, record.standard_error, record.low, record.high, record.count, record.curve
