"""`twillight gallery`: a static site of fabrics, with everything that other programs take of them."""

from __future__ import annotations

from typing import Annotated, Final

from cyclopts import Parameter

from jobs.terminal import print_lines
from jobs.verbs.exchange import named_flags
from jobs.verbs.parameters import NOTHING, Local, Whole
from jobs.verbs.show import write_swatch
from pipeline.atomic import atomic_write, refuse_unwritable
from pipeline.materials.planes import layout
from reports.exports.gallery import INDEX, PICTURE, gallery_page, write_fabric
from weaves.errors import BadInput
from weaves.fabric import load_fabric, preset_names

PICTURE_SIZE: Final = (720, 540)
"""Pixels of a picture."""


def gallery(
    fabrics: Annotated[list[str], Parameter(help="Presets or .toml files; default: all presets.")] = NOTHING,
    /,
    *,
    out: Annotated[Local, Parameter(help="Folder of the site; files of the same names are replaced.")],
    size: Annotated[Whole, Parameter(help="Texels of the longer side of maps, a power of two.")] = 1024,
    language: Annotated[list[str], Parameter(help="Of shaders, as for `export`, beside Slang; several.")] = NOTHING,
) -> None:
    """Write the site, and print where it opens.

    BadInput if a fabric, a number or a language cannot be used.
    """
    cloths = {name: load_fabric(name) for name in fabrics or preset_names()}
    if len({cloth.name for cloth in cloths.values()}) < len(cloths):
        raise BadInput("gallery", "FABRICS", ", ".join(cloths), "two have the same name; each needs its own")
    with named_flags("gallery"):
        for cloth in cloths.values():
            layout(cloth, size)  # a size that one of them cannot have ends the work before it begins
    refuse_unwritable(out / INDEX)
    cards = []
    for number, cloth in enumerate(cloths.values(), 1):
        print_lines(f"{number} of {len(cloths)}: {cloth.name}", stderr=True)
        with named_flags("gallery"):
            cards.append(write_fabric(cloth, out, size, language))
        write_swatch(cloth, out / cloth.name, PICTURE_SIZE).replace(out / cloth.name / PICTURE)
    atomic_write(out / INDEX, gallery_page(cards).encode())
    print_lines(f"{out / INDEX}: {len(cards)} fabrics; open it in a browser")
