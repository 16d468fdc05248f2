"""`twillight import` makes a fabric of a draft file, `fit` one of a measured BSDF or a data sheet.

`fit` also prints what such fits predict of what was kept back, or how far the streaks of light on a given fabric are
from those of photographs. `export`, `view` and `gallery` write fabrics for others.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from cyclopts import Parameter

from jobs.terminal import Terminal, number, print_lines, print_table, progress
from jobs.verbs.parameters import NOTHING, FabricName, Local, Whole, given, named_flags
from pipeline.atomic import atomic_write, refuse_unwritable
from reports.exports.export import export
from weaves.draft_files.read import DraftThreads, cut_out, read_draft
from weaves.draft_files.to_fabric import fabric_of
from weaves.errors import BadInput, nearest
from weaves.fabric import load_fabric, preset_names

if TYPE_CHECKING:
    from pipeline.fitting.fitted import Fitted

_PICTURE_SIZE: Final = (720, 540)  # pixels, of a gallery


@dataclass(frozen=True)
class YarnFlags:
    """Numbers of a yarn on the command line; None: those of the draft file, or of the fabric named by --like."""

    width: Annotated[float | None, Parameter(help="Width in yarn spacings, in place of the file's.")] = None
    bend: Annotated[float | None, Parameter(help="Largest inclination along a float, degrees.")] = None
    twist: Annotated[float | None, Parameter(help="Angle of the fibres to the yarn's axis, degrees.")] = None
    roughness: Annotated[float | None, Parameter(help="Roughness of the fibres.")] = None


@dataclass(frozen=True)
class ExportFlags:
    """Choices of single kinds of exports on the command line."""

    vertices: Annotated[Whole | None, Parameter(help="Of a mesh: steps across a yarn and along a cell; 64.")] = None
    repeats: Annotated[Whole | None, Parameter(help="Of a mesh: copies of the repeat in each direction; 1.")] = None
    size: Annotated[Whole | None, Parameter(help="Of maps: texels of the longer side, a power of two; 2048.")] = None
    model: Annotated[
        str | None, Parameter(help="Of a shader: soft_nodes (default), or folder of a trained neumip, curved or woven.")
    ] = None
    level: Annotated[Whole | None, Parameter(help="Of a shader: level of detail, 0, 1, 2, 4 or 8; 2.")] = None
    language: Annotated[
        list[str],
        Parameter(help="Of a shader: cpp, cuda, glsl, glsles, hlsl, metal, wgsl, onnx or all, beside Slang; several."),
    ] = field(default_factory=list)
    kind: Annotated[
        list[str],
        Parameter(help="Of a shader: behind, curvature or all, beside light and viewer in front of flat cloth."),
    ] = field(default_factory=list)
    solar: Annotated[str | None, Parameter(help="Of a BSDF: the same fabric in the colours of the solar band.")] = None
    points: Annotated[Whole | None, Parameter(help="Of a BSDF: points of a pair of patches, a power of two; 4.")] = None
    basis: Annotated[
        str | None, Parameter(help="Of a BSDF: klems (default), or tensor_tree, which Radiance alone reads.")
    ] = None


def import_draft(
    draft: Annotated[Local, Parameter(help="Draft file: .wif, .wifw, .dtx, .wpo or .twa.")],
    *,
    out: Annotated[Local, Parameter(help="Fabric file to write, ending in .toml.")],
    like: Annotated[str, Parameter(help="Fabric whose yarns give what a draft does not state.")] = "cotton_twill",
    name: Annotated[str | None, Parameter(help="Name of the fabric; default: that of the written file.")] = None,
    ends: Annotated[str, Parameter(help="Part of the draft, first and last end, such as 1-96; default: all.")] = "",
    picks: Annotated[str, Parameter(help="Part of the draft, first and last pick; default: all.")] = "",
    warp: Annotated[YarnFlags, Parameter(name="--warp")] = YarnFlags(),
    weft: Annotated[YarnFlags, Parameter(name="--weft")] = YarnFlags(),
) -> None:
    """Write the fabric of a draft file, and print what was read and what is assumed.

    BadInput if the draft, a name or a number cannot be used.
    """
    if out.suffix != ".toml":
        raise BadInput("import", "--out", str(out), "a path that ends in .toml is needed")
    # First: reading the colours of a fabric loads much, which a damaged draft need not wait for.
    file = read_draft(draft)
    file = cut_out(file, _part(ends, "--ends", file.ends), _part(picks, "--picks", file.picks))
    yarns = load_fabric(like)
    own = name if name is not None else re.sub(r"[^A-Za-z0-9_-]+", "_", out.stem).strip("_")[:60] or "draft"
    drafted = fabric_of(file, yarns, own, str(draft), {"warp": given(warp), "weft": given(weft)})
    atomic_write(out, drafted.fabric.to_toml().encode())
    program = f", written by {file.program}" if file.program else ""
    print_lines(f"{out}: fabric {own} from the draft {file.title!r}{program}")
    for heading, sentences in (("Read:", drafted.read), ("Assumed:", drafted.assumed)):
        print_lines(heading, *(f"- {sentence}" for sentence in sentences))


def _part(text: str, flag: str, threads: DraftThreads) -> tuple[int, int] | None:
    if not text:
        return None
    sides, most = re.fullmatch(r"([0-9]{1,6})-([0-9]{1,6})", text), len(threads.colours)
    if not sides or not 1 <= int(sides[1]) <= int(sides[2]) <= most:
        raise BadInput("import", flag, text, f"first and last thread are needed, such as 1-{most}")
    return int(sides[1]), int(sides[2])


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
    if compare and held_out:
        raise BadInput("fit", "--held-out", "", "goes with a measured BSDF or data sheets: leave it or --compare out")
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
        _write_fitted(fitted, out, str(path))
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
        _write_fitted(fitted, out.with_stem(out.stem + suffix), f"{path} {row}".strip(), remarks)


def _photographs(path: Path, fabric: str) -> None:
    from reports.images.photographs import read_photographs, streaks

    cloth, rows = load_fabric(fabric), []
    for kind, photograph in read_photographs(path).items():
        for way, streak in zip(("along", "across"), streaks(cloth, photograph), strict=True):
            rows.append((f"{kind}, {way} the streak", f"{streak.error:.3f}", *map(number, streak[1:])))
    print_table(("", "error of the profile", "width", "predicted"), rows)


def _name(out: Path) -> str:
    return re.sub(r"[^A-Za-z0-9_-]+", "_", out.stem)[:60]


def _write_fitted(fitted: Fitted, out: Path, source: str, remarks: Iterable[str] = ()) -> None:
    fabric = fitted.fabric.model_copy(update={"source": f"Fitted to {source} by twillight fit."})
    atomic_write(out, fabric.to_toml().encode())
    errors = ", ".join(f"{key} {number(value)}" for key, value in fitted.errors.items())
    print_lines(f"{out}: {fabric.weave.name}; errors: {errors}")
    rows = [(key, *(f"{value:.3g}" for value in estimate)) for key, estimate in fitted.numbers.items()]
    print_table(("number", "value", "from", "to"), rows)
    for heading, sentences in (("Assumed:", [*fitted.assumed, *remarks]), ("Not determined:", fitted.unknown)):
        print_lines(heading, *(f"- {sentence}" for sentence in sentences))


def export_fabric(
    fabric: FabricName,
    *,
    mesh: Annotated[Local | None, Parameter(help="Triangle mesh to write, ending in .ply.")] = None,
    wif: Annotated[Local | None, Parameter(help="Draft file for weaving programs to write, ending in .wif.")] = None,
    maps: Annotated[Local | None, Parameter(help="Folder of texture maps and materials to write.")] = None,
    shader: Annotated[Local | None, Parameter(help="Folder of a shader with its tables to write.")] = None,
    osl: Annotated[Local | None, Parameter(help="Shader for Blender's Cycles to write, ending in .osl.")] = None,
    bsdf: Annotated[Local | None, Parameter(help="BSDF for daylight simulation to write, ending in .xml.")] = None,
    options: Annotated[ExportFlags, Parameter(name="*")] = ExportFlags(),
) -> None:
    """Write a fabric for other programs, and print what was written.

    BadInput if not one path is given, or as `reports.exports.export.export`.
    """
    paths = {"mesh": mesh, "wif": wif, "maps": maps, "shader": shader, "osl": osl, "bsdf": bsdf}
    chosen = {kind: path for kind, path in paths.items() if path is not None}
    if len(chosen) != 1:
        allowed = "one of --mesh, --wif, --maps, --shader, --osl and --bsdf is needed"
        raise BadInput("export", "", " and ".join(f"--{kind}" for kind in chosen) or "nothing", allowed)
    ((what, path),) = chosen.items()
    stated = {key: value for key, value in vars(options).items() if value not in (None, [])}
    with Terminal().status(what):
        _write("export", fabric, what, path, stated)


def encode(
    samples: Annotated[Local, Parameter(help="Table of samples, .parquet or .csv, or folder of OpenEXR pictures.")],
    *,
    model: Annotated[str, Parameter(help='Folder of a trained unified_btf with head = "rgb".')],
    out: Annotated[Local, Parameter(help="Folder to write.")],
    size: Annotated[str, Parameter(help="WIDTHxHEIGHT of the measured patch in millimetres, such as 20x15.")],
    texels: Annotated[str, Parameter(help="COLUMNSxROWS of texels that a table is sorted into, such as 64x48.")] = "",
    name: Annotated[str, Parameter(help="Name of the fabric; default: that of the folder.")] = "",
) -> None:
    """Encode measured samples as a material, and print how to use it.

    BadInput if a sample, the model or a number cannot be used.
    """
    from pipeline.models.unified_btf.encode import FABRIC_FILE
    from pipeline.models.unified_btf.encode import encode as write

    width, height = _pair("--size", size)
    columns, rows = _pair("--texels", texels, whole=True) if texels else (0, 0)
    grid = (int(columns), int(rows)) if texels else None
    with Terminal().status("encoding"), named_flags("encode", "encode"):
        write(samples, grid, Path(model), name or out.name, (width, height), out)
    folder = str(out) if out.is_absolute() else f"./{out}"
    shown = shlex.join(["--fabric", f"{folder}/{FABRIC_FILE}", "--method", folder, "--out", f"{out.name}.png"])
    print_lines(f"twillight render plane {shown}")


def _pair(flag: str, text: str, whole: bool = False) -> tuple[float, float]:
    number = r"([0-9]{1,4})" if whole else r"([0-9]{1,5}(?:\.[0-9]{1,6})?)"
    sides = re.fullmatch(f"{number}x{number}", text)
    if not sides or not all(map(float, sides.groups())):
        example = "64x48, whole numbers" if whole else "20x15.5"
        raise BadInput("encode", flag, text, f"must be two numbers above 0, such as {example}")
    return float(sides[1]), float(sides[2])


def view(
    fabric: FabricName,
    *,
    out: Annotated[Local, Parameter(help="Page to write, ending in .html.")],
    truth: Annotated[
        int, Parameter(help="Pixels along each side of the pictures by the truth and other methods; 0: none.")
    ] = 160,
) -> None:
    """Write the page of a fabric, and print what was written."""
    with progress("tables and pictures") as advance:
        _write("view", fabric, "viewer", out, {"truth": truth, "progress": advance}, viewer="out")


def gallery(
    fabrics: Annotated[list[str], Parameter(help="Presets or .toml files; default: all presets.")] = NOTHING,
    /,
    *,
    out: Annotated[Local, Parameter(help="Folder of the site; files of the same names are replaced.")],
    size: Annotated[Whole, Parameter(help="Texels of the longer side of maps, a power of two.")] = 1024,
    language: Annotated[list[str], Parameter(help="Of shaders, as for `export`, beside Slang; several.")] = NOTHING,
) -> None:
    """Write a static site of fabrics, with everything that other programs take of them, and print where it opens.

    BadInput if a fabric, a number or a language cannot be used.
    """
    from jobs.verbs.show import write_swatch
    from pipeline.materials.planes import layout
    from reports.exports.gallery import INDEX, PICTURE, gallery_page, write_fabric

    cloths = {name: load_fabric(name) for name in fabrics or preset_names()}
    if len({cloth.name for cloth in cloths.values()}) < len(cloths):
        raise BadInput("gallery", "FABRICS", ", ".join(cloths), "two have the same name; each needs its own")
    with named_flags("gallery", "export"):
        for cloth in cloths.values():
            layout(cloth, size)  # a size that one of them cannot have ends the work before it begins
    refuse_unwritable(out / INDEX)
    cards = []
    for place, cloth in enumerate(cloths.values(), 1):
        print_lines(f"{place} of {len(cloths)}: {cloth.name}", stderr=True)
        with named_flags("gallery", "export"):
            cards.append(write_fabric(cloth, out, size, language))
        write_swatch(cloth, out / cloth.name, _PICTURE_SIZE).replace(out / cloth.name / PICTURE)
        atomic_write(out / INDEX, gallery_page(cards).encode())  # of what is finished, if it is stopped
    print_lines(f"{out / INDEX}: {len(cards)} fabrics; open it in a browser")


def _write(verb: str, name: str, kind: str, path: Path, options: Mapping[str, Any], **flags: str) -> None:
    with named_flags(verb, "export", **flags):
        print_lines(export(load_fabric(name), kind, path, **options))
