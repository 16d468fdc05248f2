"""`twillight list`: the fabrics and recipes of the package."""

from __future__ import annotations

from jobs.recipe.load import load_recipe, recipe_names
from jobs.terminal import print_lines, print_table
from weaves.fabric import load_fabric, preset_names


def print_lists() -> None:
    """Print a table of fabrics and a table of recipes."""
    fabrics = [load_fabric(name) for name in preset_names()]
    rows = [(one.name, one.weave.name, "{} × {}".format(*one.weave.repeat), one.source) for one in fabrics]
    print_table(("fabric", "draft", "repeat", "source"), rows, text=("draft", "repeat", "source"))
    print_lines("")
    recipes = [load_recipe(name) for name in recipe_names()]
    print_table(("recipe", "for"), [(recipe.name, recipe.about) for recipe in recipes], text=("for",))
