"""`twillight list`: the fabrics and recipes of the package."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from jobs.recipe.load import load_recipe, recipe_names
from jobs.terminal import print_lines, print_table
from jobs.verbs.parameters import Local
from weaves.fabric import load_fabric, preset_names


def print_lists(
    *,
    pictures: Annotated[Local | None, Parameter(help="Folder for a picture of every fabric.")] = None,
    size: Annotated[str, Parameter(help="WIDTHxHEIGHT of the pictures in pixels.")] = "384x288",
) -> None:
    """Print a table of fabrics and a table of recipes; or, of fabrics, write pictures."""
    if pictures is not None:
        from jobs.verbs.show import write_swatch  # numba, which the lists need not wait for

        for name in preset_names():
            print_lines(write_swatch(name, load_fabric(name), pictures, size))
        return
    fabrics = [load_fabric(name) for name in preset_names()]
    rows = [(one.name, one.weave.name, "{} × {}".format(*one.weave.repeat), one.source) for one in fabrics]
    print_table(("fabric", "draft", "repeat", "source"), rows, text=("draft", "repeat", "source"))
    print_lines("")
    recipes = [load_recipe(name) for name in recipe_names()]
    print_table(("recipe", "for"), [(recipe.name, recipe.about) for recipe in recipes], text=("for",))
