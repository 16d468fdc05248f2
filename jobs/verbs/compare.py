"""`twillight compare`: the Records of two benchmarks, and a table of their differences."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from jobs.verbs.parameters import Local, OfSeveralPages
from weaves.errors import BadInput

WHERE = "compare"


def compare(
    a: Annotated[Local, Parameter(help="Folder of products, folder of a page, or file of Records.")],
    b: Annotated[Local, Parameter(help="Another one; the table shows B relative to A.")],
    *,
    recipe: OfSeveralPages = "",
    other_machine: Annotated[bool, Parameter(help="Allow measurements of different machines.")] = False,
) -> None:
    """Print the differences of B from A.

    Raises
    ------
    BadInput
        If one has no Records or no machine, the machines differ without `other_machine`, or no measurement is shared.
    """
    from jobs.console import print_result
    from jobs.terminal import Terminal
    from reports.machines import refuse_several
    from reports.record import read_machine, read_records
    from reports.tables.compare import LEVEL, NO_DIFFERENCE, difference_tables, refuse_other_machine
    from reports.tables.compare import compare as differences
    from reports.tables.sentences import busy

    files = [records_file(path, recipe) for path in (a, b)]
    first, second = (read_records([file]) for file in files)
    for file, records in zip(files, (first, second), strict=True):
        refuse_several(records, str(file))
    machine_a, machine_b = (read_machine(file) for file in files)
    unlike = refuse_other_machine(machine_a, machine_b, other_machine)
    shared = differences(first, second)
    console = Terminal()
    for table in difference_tables(shared):
        print_result(table)
    console.print("")
    for sentence in [*unlike, *shared.unlike, *busy(first, second)]:
        console.print(f"{sentence}.", soft_wrap=True)
    left = [f"{count} only in {name}" for name, count in (("A", shared.only_a), ("B", shared.only_b)) if count]
    marked = sum(row.result not in NO_DIFFERENCE for row in (*shared.times, *shared.errors))
    count = len(shared.times) + len(shared.errors)
    summary = f"{marked} of {count} measurements differ{''.join(f'; {part}' for part in left)}"
    level = f"if nothing changed, any is marked at most once in {1 / LEVEL:.0f} comparisons (Holm)"
    load = "Load on the machine is not part of this test: first compare two runs of A, on a quiet machine."
    console.print(f"{summary}; {level}.", *([load] if shared.times else []), soft_wrap=True)


def records_file(path: Path, recipe: str = "") -> Path:
    """Return the file of Records of a path: itself, that of a page's folder, or of the page in a folder of products.

    Raises
    ------
    BadInput
        If there is none, or there are several.
    """
    from reports.record import OF_A_PAGE

    if path.is_file():
        return path
    if not path.is_dir():
        raise BadInput(str(path), "", "does not exist", "a folder of products, of a page, or a file of Records")
    if not recipe and (path / OF_A_PAGE).is_file():
        return path / OF_A_PAGE
    found = sorted(path.glob(f"report/{recipe or '*'}/{OF_A_PAGE}"))
    if not found:
        what = f"no page of the recipe {recipe}" if recipe else "no page"
        raise BadInput(str(path), "", f"holds {what} with Records", "write one with `twillight report` first")
    if len(found) > 1:
        pages = ", ".join(file.parent.name for file in found)
        raise BadInput(str(path), "", "holds several pages", f"choose one with --recipe: {pages}")
    return found[0]
