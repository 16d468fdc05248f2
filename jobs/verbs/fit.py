"""`twillight fit`: a fabric from a measured BSDF or a data sheet, or what such fits predict of what was kept back.

With photographs: how far the streaks of light on a given fabric are from theirs.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from jobs.terminal import number, print_lines, print_table, progress
from jobs.verbs.parameters import NOTHING, Local
from pipeline.atomic import atomic_write, refuse_unwritable
from weaves.errors import BadInput, nearest
from weaves.fabric import load_fabric

if TYPE_CHECKING:
    from pipeline.fitting.fitted import Fitted


def fit(
    data: Annotated[Local, Parameter(help="BSDF, data sheet or photographs; shade_6216 and fabrics are shipped.")],
    *,
    out: Annotated[Local | None, Parameter(help="Fabric file to write, ending in .toml.")] = None,
    row: Annotated[str, Parameter(help="Of a CSV file: the product.")] = "",
    like: Annotated[str, Parameter(help="Of a CSV file: the same yarns in white, for what the row lacks.")] = "",
    band: Annotated[str, Parameter(help="Of a BSDF: the band that gives the colours.")] = "visible",
    draft: Annotated[list[str], Parameter(help="Of a BSDF: a draft to try; several; default: all.")] = NOTHING,
    held_out: Annotated[bool, Parameter(help="Print what fits predict of data that they were not given.")] = False,
    compare: Annotated[str, Parameter(help="Of photographs: the fabric whose streaks of light are compared.")] = "",
) -> None:
    """Write a fabric that has the numbers of a measurement, and print these with intervals; BadInput for bad data."""
    from pipeline.fitting.measured import MEASURED

    path = MEASURED.get(str(data), data)
    if out is not None and (held_out or compare):
        other = "--compare" if compare else "--held-out"
        raise BadInput("fit", "--out", str(out), f"is not written with {other}: leave one of them out")
    if compare:
        _photographs(path, compare)
        return
    if not held_out:
        if out is None or out.suffix != ".toml":
            raise BadInput("fit", "--out", "" if out is None else str(out), "a path that ends in .toml is needed")
        refuse_unwritable(out)
    if path.suffix in (".toml", ".csv"):
        _sheet(path, out, row, like)
    else:
        _bsdf(path, out, band, draft)


def _bsdf(path: Path, out: Path | None, band: str, drafts: list[str]) -> None:
    """Fit a BSDF, or print what is predicted of its rings if nothing is to be written."""
    from pipeline.bsdf.files import read_bsdf
    from pipeline.fitting.fit_bsdf import fit_bsdf
    from pipeline.fitting.fitted import DRAFTS
    from pipeline.fitting.held_out import held_out_rings

    scattering = read_bsdf(path)
    for flag, names, known in (("--band", [band], scattering.bands), ("--draft", drafts, DRAFTS)):
        for name in names:
            if name not in known:
                raise BadInput("fit", flag, name, nearest(name, known))
    with progress("fit") as advance:
        if out is None:
            rows = held_out_rings(scattering, band, advance, drafts or list(DRAFTS))
        else:
            fitted = fit_bsdf(scattering, band, _name(out), advance, drafts=drafts or list(DRAFTS))
    if out is None:
        columns = ("", "light straight through", "reflectance", "BRDF below 65 degrees")
        print_table(columns, [(name, *map(number, errors)) for name, errors in rows.items()])
    else:
        _write(fitted, out, str(path))
        print_table(("draft", "error in those of laboratories"), [(d, f"{e:.2f}") for d, e in fitted.drafts.items()])


def _sheet(path: Path, out: Path | None, row: str, like: str) -> None:
    """Fit a data sheet, or print what is predicted of all products if nothing is to be written."""
    from pipeline.fitting.data_sheet import completed, read_sheet
    from pipeline.fitting.fit_sheet import fit_sheet
    from pipeline.fitting.held_out import predicted_transmittances

    if out is None:
        rows = predicted_transmittances(path)
        cells = [(r.product, r.band, number(r.stated), *(f"{value:.3f}" for value in r.predicted)) for r in rows]
        print_table(("product", "band", "stated", "predicted", "from", "to"), cells, text=("band",))
        return
    sheet, remarks = completed(read_sheet(path, row), read_sheet(path, like) if like else None)
    for fitted, suffix in zip(fit_sheet(sheet, _name(out)), ("", "_solar"), strict=False):
        _write(fitted, out.with_stem(out.stem + suffix), f"{path} {row}".strip(), remarks)


def _photographs(path: Path, fabric: str) -> None:
    from reports.images.photographs import read_photographs, streaks

    cloth, rows = load_fabric(fabric), []
    for kind, photograph in read_photographs(path).items():
        for way, streak in zip(("along", "across"), streaks(cloth, photograph), strict=True):
            rows.append((f"{kind}, {way} the streak", f"{streak.error:.3f}", *map(number, streak[1:])))
    print_table(("", "error of the profile", "width", "predicted"), rows)


def _name(out: Path) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "_", out.stem)[:60]


def _write(fitted: Fitted, out: Path, source: str, remarks: Iterable[str] = ()) -> None:
    fabric = fitted.fabric.model_copy(update={"source": f"Fitted to {source} by twillight fit."})
    atomic_write(out, fabric.to_toml().encode())
    errors = ", ".join(f"{key} {number(value)}" for key, value in fitted.errors.items())
    print_lines(f"{out}: {fabric.weave.name}; errors: {errors}")
    rows = [(key, *(f"{value:.3g}" for value in estimate)) for key, estimate in fitted.numbers.items()]
    print_table(("number", "value", "from", "to"), rows)
    for heading, sentences in (("Assumed:", [*fitted.assumed, *remarks]), ("Not determined:", fitted.unknown)):
        print_lines(heading, *(f"- {sentence}" for sentence in sentences))
