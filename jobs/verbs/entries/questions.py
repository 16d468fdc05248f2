"""`twillight questions`: the held-out queries of a recipe as a folder that anyone can answer, without any answer.

The same recipe gives the same bytes.
"""

import json
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from cyclopts import Parameter

from jobs.plan.dataset import DataSet
from jobs.recipe.entry import ANSWER_FILES, FORM, blank_form
from jobs.recipe.load import load_recipe
from jobs.recipe.recipe import Recipe
from jobs.terminal import print_lines
from jobs.verbs.parameters import NOTHING, Add, Local, RecipeName
from jobs.verbs.show import write_geometry
from pipeline import versions
from pipeline.folders import own_files
from pipeline.scenes.shade import colours
from pipeline.shards.entry_files import QUESTION_COLUMNS, QUESTION_FILES, RGB_COLUMNS, write_questions
from pipeline.shards.generate import ShardTask
from pipeline.truth import conventions
from reports.images.draft import drawdown
from reports.tables.table import markdown_table
from weaves.draft_files.write import wif_text
from weaves.errors import BadInput

_TEXELS: Final = 16  # of a map of the geometry, across a yarn
_LISTING: Final = "questions.json"  # lists the fabrics, and all files with their hashes
_TEMPLATE: Final = Path(__file__).with_name("questions.md")


def questions(
    recipe: RecipeName,
    *,
    to: Annotated[Local, Parameter(help="Folder to write: empty, not there, or with the questions of before.")],
    add: Add = NOTHING,
) -> None:
    """Write the questions of a recipe, its fabrics, and the form of an entry.

    BadInput if the recipe cannot be used, or the folder holds anything else.
    """
    loaded = load_recipe(recipe, add)
    if to.is_dir() and any(to.iterdir()) and not (to / _LISTING).is_file():
        raise BadInput("questions", "--to", str(to), "is not empty; name another folder, or empty it")
    shards = [part.shard for part in DataSet(loaded).shards if part.shard.split == "test"]
    with own_files(to, _LISTING) as folder:
        count = write_questions(folder, (shard for shard in shards if isinstance(shard, ShardTask)))
        about = _about(loaded)
        texts = {_LISTING: json.dumps(about), FORM: blank_form(about["questions"]), "README.md": _readme(loaded, count)}
        (folder / "fabrics").mkdir()
        for fabric, _ in loaded.tested:
            texts[f"fabrics/{fabric.name}.toml"] = fabric.to_toml()
            with suppress(BadInput):  # its colours need more threads than a draft file can have
                texts[f"fabrics/{fabric.name}.wif"] = wif_text(fabric)
            (folder / "fabrics" / f"{fabric.name}.png").write_bytes(drawdown(fabric))
            write_geometry(fabric, folder / "fabrics" / f"{fabric.name}.exr", _TEXELS)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
    print_lines(f"{to}: {count:,} questions about {len(loaded.tested)} fabrics; README.md says how to answer them")


def _about(recipe: Recipe) -> dict[str, Any]:
    dataset, rows = recipe.dataset, recipe.dataset.rows.test
    return {
        "recipe": recipe.name,
        "questions": recipe.questions,
        "truth_version": versions.TRUTH,
        "queries": dataset.queries.model_dump(mode="json"),
        "truth": recipe.physics,
        "fabrics": [
            {
                "role": role,
                "first_id": rows * index,
                "last_id": rows * (index + 1) - 1,
                "name": fabric.name,
                "repeat": fabric.weave.repeat,
                "drawdown": fabric.weave.rows(),
                "colours": np.round(colours(fabric), 9).tolist(),
                "transmitted_colours": np.round(colours(fabric, transmitted=True), 9).tolist(),
            }
            for index, (fabric, role) in enumerate(recipe.tested)
        ],
    }


def _readme(recipe: Recipe, count: int) -> str:
    columns = [(f"`{field.name}`", field.metadata[b"meaning"].decode()) for field in QUESTION_COLUMNS]
    fabrics = [
        (f"`{fabric.name}`", role, f"{fabric.weave.name}, {' × '.join(map(str, fabric.weave.repeat))}")
        for fabric, role in recipe.tested
    ]
    return _TEMPLATE.read_text(encoding="utf-8").format(
        recipe=recipe.name,
        count=f"{count:,}",
        last=f"{count - 1:,}",
        files=", ".join(f"`{name}`" for name in QUESTION_FILES),
        form=FORM,
        listing=_LISTING,
        answers=" or ".join(f"`{name}`" for name in ANSWER_FILES),
        columns=markdown_table(("column", "meaning"), columns),
        fabrics=markdown_table(("fabric", "role", "weave, ends × picks"), fabrics),
        components=", ".join(f"`{name}`" for name in conventions.COMPONENTS),
        rgb=", ".join(f"`{name}`" for name in RGB_COLUMNS),
        physics=", ".join(f"`{name} = {value}`" for name, value in recipe.physics.items()),
        conventions=str(conventions.__doc__).rstrip(),
    )
