"""A fabric as a BSDF file for daylight simulation: LBNL WINDOW, Radiance, EnergyPlus."""

from pathlib import Path
from typing import Final

from pipeline.atomic import refuse_unwritable
from pipeline.bsdf.files import write_xml
from pipeline.bsdf.klems import KLEMS_FULL
from pipeline.bsdf.of_fabric import PAIR_POINTS, fabric_bsdf
from pipeline.bsdf.tensor_tree import Square
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric, load_fabric

EMISSIVITY_ASSUMED: Final = 0.9  # emissivity of yarns, which no fabric states: that of textiles

THICKNESS_ASSUMED: Final = 5e-4  # thickness in metres of a fabric without `yarns_per_cm`

MOST_PAIR_POINTS: Final = 256
BSDF_BASES: Final = {"klems": KLEMS_FULL, "tensor_tree": Square.of(4)}  # by their names on the command line


def write_bsdf(fabric: Fabric, path: Path, solar: str = "", points: int = PAIR_POINTS, basis: str = "klems") -> str:
    """Write the BSDF of a fabric in one of `BSDF_BASES`, and return a sentence on it; the sun meets its front, z > 0.

    `solar` names the same cloth in the colours of the solar band; the file has the visible band there without it.
    `points` are those of a pair of patches, a power of two up to `MOST_PAIR_POINTS`. BadInput if a number, the path or
    the other fabric cannot be used.
    """
    if points not in {2**k for k in range(MOST_PAIR_POINTS.bit_length())}:
        raise BadInput("export", "points", points, f"a power of two from 1 to {MOST_PAIR_POINTS} is needed")
    if basis not in BSDF_BASES:
        raise BadInput("export", "basis", basis, nearest(basis, BSDF_BASES))
    refuse_unwritable(path)
    bsdf = fabric_bsdf(fabric, load_fabric(solar) if solar else None, BSDF_BASES[basis], points)
    patches, yarns = bsdf.scattering.basis, (fabric.warp, fabric.weft)
    openness = float(patches.means(bsdf.direct)[patches.normal])
    thickness = THICKNESS_ASSUMED
    if fabric.yarns_per_cm:
        thickness = sum(0.01 * yarn.width * yarn.relief / n for yarn, n in zip(yarns, fabric.yarns_per_cm, strict=True))
    write_xml(path, bsdf.scattering, fabric.name, openness, EMISSIVITY_ASSUMED, thickness, bsdf.direct)
    size = "" if fabric.yarns_per_cm else ", thickness (no yarns_per_cm)"
    bands = "visible and solar" if solar else "visible, which stands for solar too"
    (front, back), (through, _) = bsdf.scattering.hemispherical("visible")[:, :, patches.normal]
    return (
        f"{path}: {patches.name}, {bands}; at normal incidence reflectance {front:.3f} front and "
        f"{back:.3f} back, transmittance {through:.3f}, of it {openness:.3f} straight through. Assumed: emissivity "
        f"{EMISSIVITY_ASSUMED:g}{size}. Reciprocal: the mean of both ways of light, which differ by up to "
        f"{bsdf.asymmetry:.0%}"
    )
