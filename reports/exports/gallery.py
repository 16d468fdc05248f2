"""A static site of fabrics in one folder: of each a live page, maps, a draped sample, a shader and its own file.

The site needs no server and no network. `write_fabric` writes the files of one fabric beside its picture,
`gallery_page` the page of all, which searches names, weaves, fibres and sources.
"""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined

from pipeline.atomic import atomic_write
from reports.exports.export import export
from reports.exports.materials import SAMPLE
from weaves.fabric import Fabric

INDEX: Final = "index.html"
PICTURE: Final = "picture.png"

FIBRES: Final = {
    "cotton": ("cotton_twill", "denim", "gauze", "gingham", "voile"),
    "linen": ("basket",),
    "polyester": ("polyester_lining",),
    "silk": ("organza", "satin_8", "silk_charmeuse", "silk_shantung"),
    "wool": ("herringbone", "houndstooth", "pinstripe", "tartan", "wool_gabardine"),
}
"""Presets by the fibre that cloth of their name is usually made of."""


class Card(NamedTuple):
    """A fabric on the page; `files` are label and path of its files within the site, with their sizes in bytes."""

    name: str
    weave: str
    repeat: tuple[int, int]
    fibres: tuple[str, ...]
    source: str
    files: tuple[tuple[str, str, int], ...]


def write_fabric(fabric: Fabric, site: Path, size: int, languages: Sequence[str]) -> Card:
    """Write the files of a fabric into the folder of its name, and return its card.

    `size` counts the texels of the longer side of maps, `languages` are those of the shader beside Slang; the live page
    has no tiles. BadInput if a number, a language or the fabric cannot be used; as `reports.exports.export.export`.
    """
    name = fabric.name
    home = site / name
    home.mkdir(parents=True, exist_ok=True)
    export(fabric, "viewer", home / "live.html", truth=0)
    with tempfile.TemporaryDirectory(prefix="twillight-") as made:
        maps, shader = Path(made) / f"{name}-maps", Path(made) / f"{name}-shader"
        export(fabric, "maps", maps, size=size)
        export(fabric, "shader", shader, language=list(languages))
        shutil.copyfile(maps / SAMPLE, home / f"{name}.glb")
        for folder in (maps, shader):
            shutil.make_archive(str(home / folder.name), "zip", made, folder.name)
    atomic_write(home / f"{name}.toml", fabric.to_toml().encode())
    files = {
        "live page": "live.html",
        f"maps {size}": f"{name}-maps.zip",
        "GLB": f"{name}.glb",
        "shader": f"{name}-shader.zip",
        "TOML": f"{name}.toml",
    }
    listed = tuple((label, f"{name}/{file}", (home / file).stat().st_size) for label, file in files.items())
    fibres = tuple(fibre for fibre, names in FIBRES.items() if name in names)
    return Card(name, fabric.weave.name, fabric.repeat, fibres, fabric.source, listed)


def gallery_page(cards: Sequence[Card]) -> str:
    """Return the HTML of the page of some fabrics."""
    environment = Environment(
        loader=PackageLoader("reports", "exports"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    weaves = sorted({card.weave.split()[0] for card in cards})
    fibres = sorted({fibre for card in cards for fibre in card.fibres})
    return environment.get_template("gallery.html.j2").render(
        cards=cards, words={"Weave": weaves, "Fibre": fibres}, picture=PICTURE
    )
