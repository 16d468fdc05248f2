"""`twillight list`: the fabrics and recipes of the package.

Only what is printed is read and checked: colours and recipes need libraries that take seconds to start.
"""

from __future__ import annotations

from pydantic import TypeAdapter

from jobs.recipe.shipped import RECIPES, recipe_names
from jobs.terminal import print_lines, print_table
from weaves.fabric import PRESETS, Weave, preset_names
from weaves.validation import read_toml


def print_lists() -> None:
    """Print a table of fabrics and a table of recipes."""
    fabrics, weave = [read_toml(PRESETS / f"{name}.toml") for name in preset_names()], TypeAdapter(Weave)
    rows = []
    for fabric in fabrics:
        draft = weave.validate_python(fabric["draft"]).build()
        rows.append((fabric["name"], draft.name, "{} × {}".format(*draft.repeat), fabric["source"]))
    print_table(("fabric", "draft", "repeat", "source"), rows, text=("draft", "repeat", "source"))
    print_lines("")
    recipes = [read_toml(RECIPES / f"{name}.toml") for name in recipe_names()]
    print_table(("recipe", "for"), [(recipe["name"], recipe["about"]) for recipe in recipes], text=("for",))
