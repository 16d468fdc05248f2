"""BSDFs as files: Klems XML of LBNL WINDOW, or Parquet with one value a row, which is only read.

In XML rows of a block are patches scattered to, columns patches of the light. The front is the face that the sun meets.
As seen from the room, the layer's back, x runs to the right and y upwards: labels have -x of the fabric.

A row of the Parquet form is one pair of patches of a Klems basis. Its columns are `kind` (reflection, transmission),
`side` (the face that the light meets), `theta_in`, `phi_in`, `theta_out`, `phi_out` (degrees, the middles of the
patches, labels as in XML) and `value` (1/sr, without the cosine). Pairs that are left out are not known.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final, NamedTuple
from xml.etree import ElementTree

import numpy as np

from pipeline.atomic import atomic_write
from pipeline.bsdf.klems import BASES, FACES, SCATTERED, Basis, Scattering
from pipeline.compiled.arrays import Float64, Index
from pipeline.shards.query_file import open_queries
from weaves.errors import BadInput, nearest, one_line
from weaves.reading import MIB, read_bytes

COLUMNS_NEEDED: Final = ("kind", "side", "theta_in", "phi_in", "theta_out", "phi_out", "value")
"""Columns of the Parquet form; others are ignored."""

_MOST_ROWS: Final = 4 * 145 * 145
_TOLERANCE: Final = 0.01  # degrees

NAMESPACE: Final = "http://windows.lbl.gov"
_NEEDED = "a BSDF file in XML"
_BANDS: Final = {  # name in files, source and detector
    "visible": ("Visible", "CIE Illuminant D65 1nm.ssp", "ASTM E308 1931 Y.dsp"),
    "solar": ("Solar", "CIE Illuminant D65 1nm.ssp", "None"),
}
_BLOCKS = [f"{kind.capitalize()} {side.capitalize()}" for kind in SCATTERED for side in FACES]


class LayerFacts(NamedTuple):
    """Name of the product, share of normal light that goes straight, emissivity of both faces, thickness in metres."""

    name: str
    openness: float
    emissivity: float
    thickness: float


def write_klems(path: Path, scattering: Scattering, facts: LayerFacts) -> None:
    """Write a file, whole or not at all. A file without a solar band has the visible one there too."""
    ElementTree.register_namespace("", NAMESPACE)
    root = ElementTree.Element(f"{{{NAMESPACE}}}WindowElement")
    _add_texts(root, WindowElementType="System", FileType="BSDF")
    layer = _add(_add(root, "Optical"), "Layer")
    material, emissivity, openness = _add(layer, "Material"), f"{facts.emissivity:g}", f"{facts.openness:.4g}"
    _add_texts(material, Name=facts.name, Manufacturer="Twillight")
    _add(material, "Thickness", f"{facts.thickness:.4g}", unit="Meter")
    _add_texts(material, DeviceType="Other", EmissivityFront=emissivity, EmissivityBack=emissivity)
    _add_texts(material, TIR=openness, EffectiveOpennessFraction=openness)
    definition, basis = _add(layer, "DataDefinition"), scattering.basis
    _add(definition, "IncidentDataStructure", "Columns")
    angles = _add(definition, "AngleBasis")
    _add(angles, "AngleBasisName", basis.name)
    for low, high, count in zip(basis.bounds, basis.bounds[1:], basis.counts, strict=False):
        ring = _add(angles, "AngleBasisBlock")
        _add_texts(ring, Theta=f"{0.5 * (low + high) if low else 0:g}", nPhis=str(count))
        _add_texts(_add(ring, "ThetaBounds"), LowerTheta=f"{low:g}", UpperTheta=f"{high:g}")
    for band, (label, source, detector) in _BANDS.items():
        blocks = mirrored(basis, scattering.bands.get(band, scattering.bands["visible"]))
        for direction, values in zip(_BLOCKS, blocks.reshape(4, basis.patches, -1), strict=True):
            # One block each: some readers look at the first alone.
            data = _add(layer, "WavelengthData")
            _add(data, "LayerNumber", "System")
            _add(data, "Wavelength", label, unit="Integral")
            _add_texts(data, SourceSpectrum=source, DetectorSpectrum=detector)
            block, function = _add(data, "WavelengthDataBlock"), "BRDF" if "Reflection" in direction else "BTDF"
            _add_texts(block, WavelengthDataDirection=direction, ColumnAngleBasis=basis.name, RowAngleBasis=basis.name)
            # Readers expect a comma behind the last number of a row too.
            rows = ("".join(f"{value:.6g}, " for value in row) for row in values)
            _add_texts(block, ScatteringDataType=function, ScatteringData="\n".join(rows))
    ElementTree.indent(root)
    atomic_write(path, b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root))


def _add_texts(parent: ElementTree.Element, **texts: str) -> None:
    for name, text in texts.items():
        _add(parent, name, text)


def _add(parent: ElementTree.Element, name: str, text: str = "", **attributes: str) -> ElementTree.Element:
    element = ElementTree.SubElement(parent, f"{{{NAMESPACE}}}{name}", attributes)
    element.text = text or None
    return element


def read_bsdf(path: Path) -> Scattering:
    """Read a BSDF, ``.xml`` or ``.parquet``; the latter has the band ``visible``. Bands are in lower case.

    BadInput if the file is missing or damaged, has another basis or form, lacks columns or values, or sends on more
    light than arrives.
    """
    try:
        return (_read_xml(path) if path.suffix == ".xml" else _read_parquet(path)).checked(str(path))
    except FileNotFoundError as error:
        raise BadInput(str(path), "", "no such file", "the path of a BSDF, .xml or .parquet, is needed") from error


def _read_xml(path: Path) -> Scattering:
    """Read bands, in lower case, with NaN in the blocks that the file lacks."""
    where = str(path)
    try:
        root = ElementTree.fromstring(read_bytes(path, 64 * MIB, _NEEDED))
    except ElementTree.ParseError as error:
        raise BadInput(where, "", f"broken XML ({one_line(error)})", f"{_NEEDED} is needed") from error
    form = root.findtext(".//{*}IncidentDataStructure", "").strip()
    if form != "Columns":
        raise BadInput(where, "IncidentDataStructure", form, "must be Columns: matrices in a Klems basis are read")
    bands: dict[str, Float64] = {}
    basis = BASES[_name(where, root, "ColumnAngleBasis", tuple(BASES))]
    for data in root.iterfind(".//{*}WavelengthData"):
        band = data.findtext("{*}Wavelength", "").strip().lower()
        for block in data.iterfind("{*}WavelengthDataBlock"):
            for key in ("ColumnAngleBasis", "RowAngleBasis"):
                _name(where, block, key, (basis.name,))
            kind, side = _name(where, block, "WavelengthDataDirection", tuple(_BLOCKS)).lower().split()
            values = _values(where, block.findtext("{*}ScatteringData", ""), basis.patches)
            blocks = bands.setdefault(band, np.full((2, 2, basis.patches, basis.patches), np.nan))
            blocks[SCATTERED.index(kind), FACES.index(side)] = values
    return Scattering(basis, {band: mirrored(basis, blocks) for band, blocks in bands.items()})


def _name(where: str, element: ElementTree.Element, key: str, known: tuple[str, ...]) -> str:
    """Return the text of the first part of a name, which has to be known."""
    text = element.findtext(f".//{{*}}{key}", "").strip()
    if text not in known:
        raise BadInput(where, key, text, nearest(text, known))
    return text


def _values(where: str, text: str, patches: int) -> Float64:
    try:
        values = np.array(text.replace(",", " ").split(), np.float64)
    except ValueError as error:
        raise BadInput(where, "ScatteringData", one_line(error, 60), "numbers are needed") from error
    if len(values) != patches * patches:
        raise BadInput(where, "values of ScatteringData", len(values), f"{patches} x {patches} are needed")
    if not np.isfinite(values).all():
        raise BadInput(where, "ScatteringData", "not a finite number", "finite numbers are needed")
    return values.reshape(patches, patches)


def _read_parquet(path: Path) -> Scattering:
    where, needed = str(path), f"{', '.join(COLUMNS_NEEDED)} are needed"
    with open_queries(path) as file:
        if missing := [name for name in COLUMNS_NEEDED if name not in file.schema_arrow.names]:
            raise BadInput(where, "", f"columns missing: {', '.join(missing)}", needed)
        if not 0 < file.metadata.num_rows <= _MOST_ROWS:
            raise BadInput(where, "rows", file.metadata.num_rows, f"1 to {_MOST_ROWS} are needed")
        table = file.read(columns=list(COLUMNS_NEEDED))
    kind, side = (_numbers(where, table, *names) for names in (("kind", SCATTERED), ("side", FACES)))
    angles = {name: _column(where, table, name) for name in COLUMNS_NEEDED[2:]}
    for basis in BASES.values():
        out, into = (_patches(basis, angles[f"theta_{end}"], angles[f"phi_{end}"]) for end in ("out", "in"))
        if min(out.min(), into.min()) >= 0:
            break
    else:
        raise BadInput(where, "theta_in, phi_in", "no patch", f"middles of patches are needed: {', '.join(BASES)}")
    blocks = np.full((2, 2, basis.patches, basis.patches), np.nan)
    blocks[kind, side, out, into] = angles["value"]
    return Scattering(basis, {"visible": mirrored(basis, blocks)})


def _numbers(where: str, table: Any, name: str, known: tuple[str, str]) -> Index:
    """Return the numbers of words of a column, (N,)."""
    words = table[name].to_pylist()
    if strange := set(words) - set(known):
        raise BadInput(where, name, strange.pop(), f"must be {' or '.join(known)}")
    return np.array([known.index(word) for word in words])


def _column(where: str, table: Any, name: str) -> Float64:
    values = table[name].to_numpy()
    if values.dtype.kind not in "fiu":
        raise BadInput(where, f"type of column {name}", str(table.schema.field(name).type), "numbers are needed")
    if not np.isfinite(values).all():
        raise BadInput(where, name, "not a finite number", "finite numbers are needed")
    return np.asarray(values, np.float64)


def _patches(basis: Basis, theta: Float64, phi: Float64) -> Index:
    """Return the patch of each pair of angles, (N,); -1 if they are the middle of none."""
    middles = np.mean([basis.bounds[:-1], basis.bounds[1:]], axis=0)
    middles[0] = 0.0
    ring = np.abs(theta[:, None] - middles).argmin(axis=1)
    counts = np.array(basis.counts)[ring]
    turn = phi * counts / 360.0
    patch = np.concatenate([[0], np.cumsum(basis.counts)[:-1]])[ring] + np.round(turn).astype(int) % counts
    good = (np.abs(theta - middles[ring]) < _TOLERANCE) & (np.abs(turn - np.round(turn)) < _TOLERANCE)
    return np.asarray(np.where(good, patch, -1))


def mirrored(basis: Basis, blocks: Float64) -> Float64:
    """Return blocks (..., P, P) with labels (-x, y) in place of (x, y)."""
    counts = np.array(basis.counts)[basis.ring]
    # Azimuth a becomes 180 degrees - a.
    mirror = np.arange(basis.patches) - basis.number + (counts // 2 - basis.number) % counts
    return np.asarray(blocks[..., mirror[:, None], mirror])
