"""`twillight list`: the fabrics and recipes of the package."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from jobs.console import table_of
from jobs.recipe.load import load_recipe, recipe_names
from jobs.recipe.recipe import Recipe
from jobs.terminal import Terminal
from weaves.fabric import Fabric, load_fabric, preset_names


def print_lists() -> None:
    """Print a table of fabrics and a table of recipes."""
    console = Terminal()
    console.print(fabrics_table([load_fabric(name) for name in preset_names()]))
    console.print()
    console.print(recipes_table([load_recipe(name) for name in recipe_names()]))


def fabrics_table(fabrics: Sequence[Fabric]) -> Table:
    """List fabrics: name, draft, repeat, source."""
    table = table_of("fabric", "draft", "repeat", "source")
    for fabric in fabrics:
        ends, picks = fabric.weave.repeat
        table.add_row(fabric.name, fabric.weave.name, f"{ends} × {picks}", fabric.source)
    return table


def recipes_table(recipes: Sequence[Recipe]) -> Table:
    """List recipes: name and purpose."""
    table = table_of("recipe", "for")
    for recipe in recipes:
        table.add_row(recipe.name, recipe.about)
    return table
