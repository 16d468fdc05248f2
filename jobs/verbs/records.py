"""Records of pages: `twillight compare` and `records merge`, and `results`, which writes the tables of a page."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from jobs.recipe.load import load_recipe
from jobs.terminal import number, print_lines, print_table
from jobs.verbs.parameters import NOTHING, OUT, Add, Local, Out, RecipeName
from pipeline.atomic import atomic_write
from reports.machines import join, names_of, refuse_several
from reports.record import OF_A_PAGE, Record, read_machine, read_records, write_records
from weaves.errors import BadInput
from weaves.reading import MIB, read_text

OfSeveralPages = Annotated[str, Parameter(help="Recipe, if a folder of products has several pages.")]

_MERGE = "records merge"


def records_file(path: Path, recipe: str = "") -> Path:
    """Return the file of Records of a path: itself, that of a page's folder, or of the page in a folder of products.

    BadInput if there is none, or there are several.
    """
    if path.is_file():
        return path
    if not path.is_dir():
        raise BadInput(str(path), "", "does not exist", "a folder of products, of a page, or a file of Records")
    if not recipe and (path / OF_A_PAGE).is_file():
        return path / OF_A_PAGE
    files = sorted(path.glob(f"report/{recipe or '*'}/{OF_A_PAGE}"))
    if not files:
        what = f"no page of the recipe {recipe}" if recipe else "no page"
        raise BadInput(str(path), "", f"holds {what} with Records", "write one with `twillight report` first")
    if len(files) > 1:
        pages = ", ".join(file.parent.name for file in files)
        raise BadInput(str(path), "", "holds several pages", f"choose one with --recipe: {pages}")
    return files[0]


def compare(
    a: Annotated[Local, Parameter(help="Folder of products, folder of a page, or file of Records.")],
    b: Annotated[Local, Parameter(help="Another one; the table shows B relative to A.")],
    *,
    recipe: OfSeveralPages = "",
    other_machine: Annotated[bool, Parameter(help="Allow measurements of different machines.")] = False,
) -> None:
    """Print the differences of B from A.

    BadInput if one has no Records or no machine, the machines differ without `other_machine`, or nothing is shared.
    """
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
    for table in difference_tables(shared):
        print_lines("")
        print_table(
            table.columns,
            [(row.label, *row.cells) for row in table.rows],
            text=[column for index, column in enumerate(table.columns) if not table.numeric(index)],
            title=table.title,
            styles={index: "bold" for index, row in enumerate(table.rows) if row.kind == "marked"},
        )
    print_lines("", *(f"{sentence}." for sentence in (*unlike, *shared.unlike, *busy(first, second))))
    left = [f"{count} only in {name}" for name, count in (("A", shared.only_a), ("B", shared.only_b)) if count]
    marked = sum(row.result not in NO_DIFFERENCE for row in (*shared.times, *shared.errors))
    count = len(shared.times) + len(shared.errors)
    summary = f"{marked} of {count} measurements differ{''.join(f'; {part}' for part in left)}"
    print_lines(f"{summary}; if nothing changed, any is marked at most once in {1 / LEVEL:.0f} comparisons (Holm).")
    if shared.times:
        print_lines("Load on the machine is not part of this test: first compare two runs of A, on a quiet machine.")


def results(
    recipe: RecipeName,
    *,
    file: Annotated[Local | None, Parameter(help="Markdown file to write; results.md beside the page.")] = None,
    readme: Annotated[Local | None, Parameter(help="Markdown file whose generated table is written anew.")] = None,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """Write all tables of a recipe's page to `file`, or six rows of them into the block of `readme`.

    BadInput if the recipe has no page in `out`, its Records are incomplete, or `readme` has no such block.
    """
    from reports.tables.documents import readme_block, results_page, split_at_block

    name = load_recipe(recipe, add).name
    source = records_file(out, name)
    records, machine = read_records([source]), read_machine(source)
    if readme is not None:
        if not readme.is_file():
            raise BadInput(str(readme), "", "does not exist", "a Markdown file with a generated block is needed")
        text = read_text(readme, MIB, "a Markdown file")
        before, old, after = split_at_block(text, str(readme))
        fresh = f"{before}{readme_block(records, machine, old, str(source)).rstrip()}\n{after}"
        if fresh != text:
            atomic_write(readme, fresh.encode())
        print_lines(f"{readme}: table of {name} {'unchanged' if fresh == text else 'written'}")
    if readme is None or file is not None:
        file = file or source.with_name("results.md")
        atomic_write(file, results_page(records, machine, str(source)).encode())
        print_lines(f"{file}: written")


def merge_records(
    files: Annotated[list[Local], Parameter(help="Files of Records, folders of pages, or folders of products.")],
    *,
    recipe: OfSeveralPages = "",
    out: Annotated[Local, Parameter(help="File of Records to write, ending in .json.")],
) -> None:
    """Join Records, write them to `out`, and print the time of a query of each method on each machine.

    BadInput if fewer than two files are given, one has no Records or no machine or holds several machines, or `out` is
    one of them, no name of a .json file, or in no folder.
    """
    if len(files) < 2:
        raise BadInput(_MERGE, "files", [str(path) for path in files], "two files of Records or more are needed")
    sources = [records_file(path, recipe) for path in files]
    if out.suffix != ".json" or not out.parent.is_dir():
        raise BadInput(_MERGE, "--out", str(out), "must be a file in a folder that exists, ending in .json")
    if out.resolve() in [file.resolve() for file in sources]:
        raise BadInput(_MERGE, "--out", str(out), "is one of the files to join; another name is needed")
    machines = [read_machine(file) for file in sources]
    names = names_of(machines)
    joined = join(dict(zip(names, (read_records([file]) for file in sources), strict=True)))
    shared_packages = set.intersection(*(set(machine.packages.items()) for machine in machines))
    packages = {name: version for name, version in machines[0].packages.items() if (name, version) in shared_packages}
    write_records(out, joined.records, machines[0].model_copy(update={"cpu": "; ".join(names), "packages": packages}))
    _print_times(joined.records, names)
    for index, (name, machine) in enumerate(zip(names, machines, strict=True)):
        print_lines(f"{_letter(index)}: {name}, {machine.date}")
    alike = f"{joined.shared:,} are alike and kept once"
    print_lines(f"{out}: {len(joined.records):,} Records of {len(names)} machines; {alike}")
    if joined.unlike:
        a, b = joined.unlike[0]
        what = " ".join(filter(None, (a.metric, "of", a.method, a.setting, a.fabric or a.scene)))
        unlike = f"{len(joined.unlike):,} numbers differ and both are kept"
        print_lines(f"{unlike}, such as {what}: {a.value:g} and {b.value:g}")


def _print_times(records: Sequence[Record], names: Sequence[str]) -> None:
    """Print the time of a query on one thread: a row a method, a column a machine."""
    times: dict[str, dict[str, float]] = {}
    for record in records:
        if record.metric == "time" and not record.role and record.threads in (0, 1):
            method = f"{record.method} {record.setting}".strip()
            times.setdefault(method, {})[record.provenance.machine] = record.value
    columns = ["method", *(f"{_letter(index)}, ns a query" for index in range(len(names)))]
    nan = float("nan")
    print_table(columns, [(method, *(number(of.get(name, nan)) for name in names)) for method, of in times.items()])


def _letter(index: int) -> str:
    return chr(ord("A") + index) if index < 26 else str(index + 1)
