"""BSDF files of LBNL WINDOW in a Klems basis, read and written.

Rows of a block are patches scattered to, columns patches of the light. In files the front is the face that the sun
meets. As seen from the room, the layer's back, x runs to the right and y upwards: labels have -x of the fabric.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy import typing as npt

from pipeline.atomic import atomic_write
from pipeline.bsdf.klems import BASES, FACES, SCATTERED, Basis, Scattering
from pipeline.compiled.arrays import Float64
from weaves.errors import BadInput

NAMESPACE: Final = "http://windows.lbl.gov"
_BANDS: Final = {  # name in files, source and detector
    "visible": ("Visible", "CIE Illuminant D65 1nm.ssp", "ASTM E308 1931 Y.dsp"),
    "solar": ("Solar", "CIE Illuminant D65 1nm.ssp", "None"),
}
_LARGEST_FILE = 2**28


class LayerFacts(NamedTuple):
    """Facts of a layer beside its BSDF.

    Attributes
    ----------
    name : str
        Of the product.
    openness : float
        Share of light at normal incidence that goes straight through.
    emissivity : float
        Of both faces, for heat.
    thickness : float
        In metres.
    """

    name: str
    openness: float
    emissivity: float
    thickness: float


def write_klems(path: Path, scattering: Scattering, facts: LayerFacts) -> None:
    """Write a file, whole or not at all. A file without a solar band has the visible one there too."""
    ElementTree.register_namespace("", NAMESPACE)
    root = ElementTree.Element(f"{{{NAMESPACE}}}WindowElement")
    for name, text in (("WindowElementType", "System"), ("FileType", "BSDF")):
        _add(root, name, text)
    layer = _add(_add(root, "Optical"), "Layer")
    material = _add(layer, "Material")
    for name, text in (
        ("Name", facts.name),
        ("Manufacturer", "Twillight"),
        ("Thickness", f"{facts.thickness:.4g}"),
        ("DeviceType", "Other"),
        ("EmissivityFront", f"{facts.emissivity:g}"),
        ("EmissivityBack", f"{facts.emissivity:g}"),
        ("TIR", f"{facts.openness:.4g}"),
        ("EffectiveOpennessFraction", f"{facts.openness:.4g}"),
    ):
        _add(material, name, text, **({"unit": "Meter"} if name == "Thickness" else {}))
    definition = _add(layer, "DataDefinition")
    _add(definition, "IncidentDataStructure", "Columns")
    _add_basis(_add(definition, "AngleBasis"), scattering.basis)
    for band, (label, source, detector) in _BANDS.items():
        blocks = mirrored(scattering.basis, scattering.bands.get(band, scattering.bands["visible"]))
        for k, kind in enumerate(SCATTERED):
            for s, side in enumerate(FACES):
                # One block each: some readers look at the first alone.
                data = _add(layer, "WavelengthData")
                _add(data, "LayerNumber", "System")
                _add(data, "Wavelength", label, unit="Integral")
                _add(data, "SourceSpectrum", source)
                _add(data, "DetectorSpectrum", detector)
                block = _add(data, "WavelengthDataBlock")
                _add(block, "WavelengthDataDirection", f"{kind.capitalize()} {side.capitalize()}")
                _add(block, "ColumnAngleBasis", scattering.basis.name)
                _add(block, "RowAngleBasis", scattering.basis.name)
                _add(block, "ScatteringDataType", "BRDF" if kind == "reflection" else "BTDF")
                # Readers expect a comma behind the last number of a row too.
                rows = ("".join(f"{value:.6g}, " for value in row) for row in blocks[k, s])
                _add(block, "ScatteringData", "\n".join(rows))
    ElementTree.indent(root)
    atomic_write(path, b'<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root))


def read_klems(path: Path) -> Scattering:
    """Read a file, and check its energy.

    BadInput names what cannot be used: not XML, another basis, a block of another size, energy above 1.
    """
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise BadInput(str(path), "", f"{path.stat().st_size:,} bytes", f"at most {_LARGEST_FILE:,} are read")
        text = path.read_bytes()
        if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
            raise BadInput(str(path), "", "a document type", "leave it out: BSDF files need none")
        root = ElementTree.fromstring(text)
    except OSError as error:
        raise BadInput(str(path), "", error.strerror or "cannot be read", "a readable file is needed") from error
    except ElementTree.ParseError as error:
        raise BadInput(str(path), "", f"not XML: {error}", "a BSDF file of LBNL WINDOW is needed") from error
    bases, bands = set[str](), dict[str, Float64]()
    for data in root.iter(f"{{{NAMESPACE}}}WavelengthData"):
        band = _text(path, data, "Wavelength").lower()
        for block in data.iter(f"{{{NAMESPACE}}}WavelengthDataBlock"):
            name = _text(path, block, "ColumnAngleBasis")
            if name not in BASES or _text(path, block, "RowAngleBasis") != name:
                allowed = f"must be that of the rows, one of {', '.join(BASES)}"
                raise BadInput(str(path), "ColumnAngleBasis", name, allowed)
            bases.add(name)
            if len(bases) > 1:
                raise BadInput(str(path), "ColumnAngleBasis", name, "all blocks must have one basis")
            count = BASES[name].patches
            blocks = bands.setdefault(band, np.full((2, 2, count, count), np.nan))
            what = _text(path, block, "WavelengthDataDirection").lower().split()
            if len(what) != 2 or what[0] not in SCATTERED or what[1] not in FACES:
                continue  # such as absorptance
            place = SCATTERED.index(what[0]), FACES.index(what[1])
            blocks[place] = _matrix(path, _text(path, block, "ScatteringData"), count)
    if not bands:
        raise BadInput(str(path), "", "no data of a wavelength", "a BSDF file of LBNL WINDOW is needed")
    basis = BASES[bases.pop()]
    known = {band: mirrored(basis, blocks) for band, blocks in bands.items() if np.isfinite(blocks).any()}
    return Scattering(basis, known).checked(str(path))


def mirrored(basis: Basis, blocks: Float64) -> Float64:
    """Return blocks (..., P, P) with labels (-x, y) in place of (x, y)."""
    counts = np.array(basis.counts)[basis.ring]
    # Azimuth a becomes 180 degrees - a.
    mirror = np.arange(basis.patches) - basis.number + (counts // 2 - basis.number) % counts
    return np.asarray(blocks[..., mirror[:, None], mirror])


def _matrix(path: Path, text: str, count: int) -> Float64:
    try:
        numbers: npt.NDArray[np.float64] = np.array(text.replace(",", " ").split(), np.float64)
    except ValueError as error:
        raise BadInput(str(path), "ScatteringData", str(error), "numbers are needed") from error
    if numbers.size != count * count or not np.isfinite(numbers).all():
        allowed = f"{count} x {count} finite numbers are needed for this basis"
        raise BadInput(str(path), "ScatteringData", f"{numbers.size} numbers", allowed)
    return numbers.reshape(count, count)


def _text(path: Path, element: ElementTree.Element, name: str) -> str:
    text = element.findtext(f"{{{NAMESPACE}}}{name}")
    if text is None:
        raise BadInput(str(path), name, "missing", "a BSDF file of LBNL WINDOW is needed")
    return text.strip()


def _add_basis(parent: ElementTree.Element, basis: Basis) -> None:
    _add(parent, "AngleBasisName", basis.name)
    for low, high, count in zip(basis.bounds, basis.bounds[1:], basis.counts, strict=False):
        block = _add(parent, "AngleBasisBlock")
        _add(block, "Theta", f"{0.5 * (low + high) if low else 0:g}")
        _add(block, "nPhis", str(count))
        bounds = _add(block, "ThetaBounds")
        _add(bounds, "LowerTheta", f"{low:g}")
        _add(bounds, "UpperTheta", f"{high:g}")


def _add(parent: ElementTree.Element, name: str, text: str = "", **attributes: str) -> ElementTree.Element:
    element = ElementTree.SubElement(parent, f"{{{NAMESPACE}}}{name}", attributes)
    element.text = text or None
    return element
