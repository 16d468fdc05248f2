"""`twillight challenge board`: measured entries of the same questions, by class, from their folders alone."""

from __future__ import annotations

from typing import Annotated, Final

from cyclopts import Parameter

from jobs.recipe.entry import FORM, EntryForm, is_plain
from jobs.terminal import print_lines
from jobs.verbs.parameters import Local
from pipeline.atomic import atomic_write
from reports.catalogue import columns_of
from reports.record import Record, read_records
from reports.tables.page_tables import ENTRY_CLASSES, entry_class, page_frames, result_tables
from weaves.errors import BadInput
from weaves.validation import read_toml, validated

_HEAD: Final = """\
# Entries

Written by `twillight challenge board` from the folders of {count} entries, which answer the questions `{questions}`. \
Errors were measured by benchmark version {version}, on the data set `{dataset}`; whoever has the recipe measures them \
again with `twillight bench RECIPE --answers FOLDER`. Costs are stated by the entrants. Entries are compared within a \
class only: the most multiply-adds of a query, and bytes of a fabric."""


def board(
    entries: Annotated[list[Local], Parameter(help="Folders that `bench --answers` left in out/entries.")],
    *,
    to: Annotated[Local, Parameter(help="Markdown file to write.")],
) -> None:
    """Write the tables of entries; BadInput if one was not measured, two have one name, or their rows differ."""
    by_class: dict[str, list[Record]] = {entry_class(size): [] for size in (*ENTRY_CLASSES, ENTRY_CLASSES[-1] + 1)}
    facts: dict[str, object] = {}
    names = set[str]()
    for folder in entries:
        form = validated(EntryForm, read_toml(folder / FORM), str(folder / FORM))
        records = read_records([folder / "records.json"])
        whole = {record.method for record in records} == {form.name}
        if not whole or not {record.metric for record in records} >= {*columns_of("entries")}:
            raise BadInput(str(folder / "records.json"), "", "holds other Records", f"those of {form.name} are needed")
        costs = [record for record in records if record.metric in columns_of("entries")]
        stated = [(record.metric, record.value, record.note) for record in costs]
        if sorted(stated) != sorted(form.costs):
            raise BadInput(str(folder / "records.json"), "", "states other costs", f"those of {FORM} are needed")
        if not all(is_plain(record.fabric + record.setting) for record in records):
            raise BadInput(str(folder / "records.json"), "", "has names with signs of Markdown", "letters are needed")
        if form.name in names:
            raise BadInput(str(folder), "name", form.name, "is the name of another entry")
        names.add(form.name)
        about = records[0].provenance
        for key, value in (("questions", form.questions), ("version", about.version), ("dataset", about.dataset)):
            if (known := facts.setdefault(key, value)) != value:
                raise BadInput(str(folder), key, value, f"that of the entries before is {known}")
        by_class[entry_class(max(form.bytes_stored, form.multiply_adds))] += records
    parts = [_HEAD.format(count=len(entries), **facts)]
    for name, records in by_class.items():
        tables = result_tables(records, page_frames(records), {}) if records else {}
        shown = [table for section in ("entries", "error") for table in tables.get(section, ())]
        parts += [f"## {name}"] if shown else []
        parts += [f"### {table.title}\n\n{table.markdown()}" for table in shown]
    atomic_write(to, ("\n\n".join(parts) + "\n").encode())
    print_lines(f"{to}: {len(entries)} entries")
