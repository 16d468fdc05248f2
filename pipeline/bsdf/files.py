"""BSDFs as files: XML of LBNL WINDOW, or Parquet with one value a row, which is only read.

XML has matrices in a Klems basis, or tensor trees, which Radiance alone reads. Rows of a matrix are patches scattered
to, columns patches of the light. The front is the face that the sun meets.
As seen from the room, the layer's back, x runs to the right and y upwards: labels have -x of the fabric.

A row of the Parquet form is one pair of patches of a Klems basis. Its columns are `kind` (reflection, transmission),
`side` (the face that the light meets), `theta_in`, `phi_in`, `theta_out`, `phi_out` (degrees, the middles of the
patches, labels as in XML) and `value` (1/sr, without the cosine). Pairs that are left out are not known.
"""

from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from pipeline.atomic import atomic_write
from pipeline.bsdf.klems import BASES, FACES, KLEMS_FULL, SCATTERED, Basis, Scattering
from pipeline.bsdf.tensor_tree import RANKS, SHIRLEY_CHIU, Square, read_tree, tree_text
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
_MATRIX_KEYS: Final[tuple[str, ...]] = ("ColumnAngleBasis", "RowAngleBasis")  # elements that name the basis
_TREE_KEYS: Final[tuple[str, ...]] = ("AngleBasis",)
_BLOCKS = [f"{kind.capitalize()} {side.capitalize()}" for kind in SCATTERED for side in FACES]


def write_xml(
    path: Path, scattering: Scattering, name: str, openness: float, emissivity: float, thickness: float,
    straight: Float64 | None = None,
) -> None:  # fmt: skip
    """Write a file, whole or not at all: a tensor tree if the basis is a `Square`.

    `name` is that of the product, `openness` the share of normal light that goes straight, `emissivity` that of both
    faces, `thickness` in metres. A layer without a solar band has the visible one there too. `straight` is as in
    `tree_text`, for a tree alone.
    """
    ElementTree.register_namespace("", NAMESPACE)
    root = ElementTree.Element(f"{{{NAMESPACE}}}WindowElement")
    _add_texts(root, WindowElementType="System", FileType="BSDF")
    layer = _add(_add(root, "Optical"), "Layer")
    material, emitted, open_share = _add(layer, "Material"), f"{emissivity:g}", f"{openness:.4g}"
    _add_texts(material, Name=name, Manufacturer="Twillight")
    _add(material, "Thickness", f"{thickness:.4g}", unit="Meter")
    _add_texts(material, DeviceType="Other", EmissivityFront=emitted, EmissivityBack=emitted)
    _add_texts(material, TIR=open_share, EffectiveOpennessFraction=open_share)
    definition, basis = _add(layer, "DataDefinition"), scattering.basis
    keys, bands = _MATRIX_KEYS, scattering.mirrored().bands
    if isinstance(basis, Square):
        _add(definition, "IncidentDataStructure", "TensorTree4")
        keys, straight = _TREE_KEYS, None if straight is None else straight[basis.of_lobes.mirror]
    else:
        _add(definition, "IncidentDataStructure", "Columns")
        _add_rings(_add(definition, "AngleBasis"), basis)
    for band, (label, source, detector) in _BANDS.items():
        for direction, values in zip(
            _BLOCKS, bands.get(band, bands["visible"]).reshape(4, basis.patches, -1), strict=True
        ):
            # One block each: some readers look at the first alone.
            data = _add(layer, "WavelengthData")
            _add(data, "LayerNumber", "System")
            _add(data, "Wavelength", label, unit="Integral")
            _add_texts(data, SourceSpectrum=source, DetectorSpectrum=detector)
            block, reflected = _add(data, "WavelengthDataBlock"), "Reflection" in direction
            _add_texts(block, WavelengthDataDirection=direction, **dict.fromkeys(keys, basis.name))
            if isinstance(basis, Square):
                text = tree_text(values, basis, None if reflected else straight)
            else:  # readers expect a comma behind the last number of a row too
                text = "\n".join("".join(f"{value:.6g}, " for value in row) for row in values)
            _add_texts(block, ScatteringDataType="BRDF" if reflected else "BTDF", ScatteringData=text)
    ElementTree.indent(root)
    atomic_write(path, b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root))


def _add_rings(parent: ElementTree.Element, basis: Basis) -> None:
    _add(parent, "AngleBasisName", basis.name)
    for low, high, count in zip(basis.bounds, basis.bounds[1:], basis.counts, strict=False):
        ring = _add(parent, "AngleBasisBlock")
        _add_texts(ring, Theta=f"{0.5 * (low + high) if low else 0:g}", nPhis=str(count))
        _add_texts(_add(ring, "ThetaBounds"), LowerTheta=f"{low:g}", UpperTheta=f"{high:g}")


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
    """Read bands, in lower case, with NaN in the blocks that the file lacks; a tensor tree as Klems full."""
    where = str(path)
    try:
        root = ElementTree.fromstring(read_bytes(path, 64 * MIB, _NEEDED))
    except ElementTree.ParseError as error:
        raise BadInput(where, "", f"broken XML ({one_line(error)})", f"{_NEEDED} is needed") from error
    form = root.findtext(".//{*}IncidentDataStructure", "").strip()
    if form not in ("Columns", *RANKS):
        raise BadInput(where, "IncidentDataStructure", form, f"must be one of Columns, {', '.join(RANKS)}")
    bands: dict[str, Float64] = {}
    if form in RANKS:
        keys, basis, known = _TREE_KEYS, KLEMS_FULL, (SHIRLEY_CHIU,)
    else:
        keys = _MATRIX_KEYS
        basis = BASES[_name(where, root, keys[0], tuple(BASES))]
        known = (basis.name,)
    for data in root.iterfind(".//{*}WavelengthData"):
        band = data.findtext("{*}Wavelength", "").strip().lower()
        for block in data.iterfind("{*}WavelengthDataBlock"):
            for key in keys:
                _name(where, block, key, known)
            kind, side = _name(where, block, "WavelengthDataDirection", tuple(_BLOCKS)).lower().split()
            text = block.findtext("{*}ScatteringData", "")
            values = read_tree(where, text, RANKS[form]) if form in RANKS else _values(where, text, basis.patches)
            blocks = bands.setdefault(band, np.full((2, 2, basis.patches, basis.patches), np.nan))
            blocks[SCATTERED.index(kind), FACES.index(side)] = values
    return Scattering(basis, bands).mirrored()


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
    return Scattering(basis, {"visible": blocks}).mirrored()


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
