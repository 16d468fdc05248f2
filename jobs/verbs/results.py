"""Numbers of a page as Markdown: the table of README.md, and reports/RESULTS.md."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from jobs.recipe.load import load_recipe
from jobs.terminal import Terminal
from jobs.verbs.compare import records_file
from jobs.verbs.parameters import NOTHING, OUT, Add, Local, Out, RecipeName
from pipeline.atomic import atomic_write
from weaves.errors import BadInput
from weaves.reading import MIB, read_text


def results(
    recipe: RecipeName,
    *,
    file: Annotated[Local | None, Parameter(help="Markdown file to write; results.md beside the page.")] = None,
    readme: Annotated[Local | None, Parameter(help="Markdown file whose generated table is written anew.")] = None,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """Write all tables of a recipe's page to `file`, or six rows of them into the block of `readme`.

    Raises
    ------
    BadInput
        If the recipe has no page in `out`, its Records are incomplete, or `readme` has no such block.
    """
    from reports.record import read_machine, read_records
    from reports.tables.documents import README_BLOCK, block, readme_block, results_page, with_block

    name = load_recipe(recipe, add).name
    source = records_file(out, name)
    records, machine = read_records([source]), read_machine(source)
    if readme is not None:
        if not readme.is_file():
            raise BadInput(str(readme), "", "does not exist", "a Markdown file with a generated block is needed")
        text = read_text(readme, MIB, "a Markdown file")
        old = block(text, README_BLOCK, str(readme))
        fresh = with_block(text, README_BLOCK, readme_block(records, machine, old, str(source)), str(readme))
        if fresh != text:
            atomic_write(readme, fresh.encode())
        outcome = "unchanged" if fresh == text else "written"
        Terminal().print(f"{readme}: table of {name} {outcome}", soft_wrap=True)
    if readme is None or file is not None:
        file = file or source.with_name("results.md")
        atomic_write(file, results_page(records, machine, str(source)).encode())
        Terminal().print(f"{file}: written", soft_wrap=True)
