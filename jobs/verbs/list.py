"""`twillight list`: the fabrics and recipes of the package.

Only what is printed is read and checked: colours and recipes need libraries that take seconds to start.
"""

from typing import Annotated, Final

from cyclopts import Parameter
from pydantic import TypeAdapter

from jobs.recipe.shipped import RECIPES, recipe_names
from jobs.terminal import print_lines, print_table
from jobs.verbs.parameters import Local
from weaves.errors import BadInput
from weaves.fabric import PRESETS, Weave, load_fabric, preset_names
from weaves.validation import read_toml

_SIZE: Final = "384x288"


def print_lists(
    *,
    pictures: Annotated[Local | None, Parameter(help="Folder for a picture of every fabric.")] = None,
    size: Annotated[str, Parameter(help="WIDTHxHEIGHT of the pictures in pixels.")] = _SIZE,
) -> None:
    """Print a table of fabrics and a table of recipes; or, of fabrics, write pictures."""
    if pictures is not None:
        # Libraries that the lists need not wait for.
        from jobs.verbs.render import size_of
        from jobs.verbs.show import write_swatch

        film = size_of(size, "list")
        for name in preset_names():
            print_lines(write_swatch(load_fabric(name), pictures, film))
        return
    if size != _SIZE:
        raise BadInput("list", "", "--pictures is missing", "a folder is needed for pictures")
    fabrics, weave = [read_toml(PRESETS / f"{name}.toml") for name in preset_names()], TypeAdapter(Weave)
    rows = []
    for fabric in fabrics:
        draft = weave.validate_python(fabric["draft"]).build()
        rows.append((fabric["name"], draft.name, "{} × {}".format(*draft.repeat), fabric["source"]))
    print_table(("fabric", "draft", "repeat", "source"), rows, text=("draft", "repeat", "source"))
    print_lines("")
    recipes = [read_toml(RECIPES / f"{name}.toml") for name in recipe_names()]
    print_table(("recipe", "for"), [(recipe["name"], recipe["about"]) for recipe in recipes], text=("for",))
