"""`soft_nodes.json`, or that of another model: an exported folder, for a program that has not seen this package."""

from collections.abc import Callable
from importlib.metadata import version
from typing import Any, Final, NamedTuple

import numpy as np
from pydantic import Field

from pipeline.compiled.arrays import Float32
from pipeline.scenes.shade import colours as linear_colours
from pipeline.shader.constants import TEXTURE_WIDTH
from pipeline.shader.golden import COLOUR, DENSITY_COLUMN, GOLDEN_COLUMNS, TRANSPARENCY_COLUMN, Golden
from pipeline.shader.tables import Place
from pipeline.truth.conventions import COMPONENTS
from weaves.fabric import Fabric
from weaves.validation import Frozen

GOLDEN: Final = "golden.json"


class Buffer(Frozen, use_attribute_docstrings=True):
    """A buffer that the shader reads."""

    files: dict[str, str]
    """Paths by type; one of them is loaded."""
    channels: int
    """Numbers in an element."""
    elements: int
    """Elements; as a texture they fill rows of `texture_width`, the last one in part."""
    arrays: dict[str, Place]
    """Arrays in it, after the scalars."""


class PlacedLayer(Frozen, use_attribute_docstrings=True):
    """A layer: outputs = activation(biases + inputs times weights)."""

    network: str
    """Network that it belongs to; its layers follow each other."""
    biases: Place
    """Biases, filled up with zeros to whole elements."""
    weights: Place
    """Weights (inputs, outputs), row-major: row i has those from input i; filled up with zeros."""
    activation: str
    """Function of each output."""


class Networks(Frozen, use_attribute_docstrings=True):
    """The networks of a model, in the buffer `weights`. Offsets are in elements, shapes in numbers."""

    name: str
    """Name of the trained model."""
    trained_on: dict[str, tuple[float, float]]
    """Ranges of what it was trained on: footprints and yarns."""
    outside: str
    """Why the fabric lies outside these ranges; empty if it does not."""
    inputs: dict[str, list[str]]
    """Inputs of each network, in their order."""
    outputs: dict[str, str]
    """Meaning of the outputs of each network."""
    layers: list[PlacedLayer]
    """Layers, in the order of their computation."""
    onnx: dict[str, str]
    """Inputs of the ONNX form, each of N rows; its output is `components`, (N, 4)."""


INPUTS: Final = {
    "centre": "middle of the footprint, in yarn spacings: x along the weft, y along the warp; any number",
    "deviation": "standard deviations of the Gaussian footprint along x and y, in yarn spacings; at least 0.001",
    "correlation": "of both axes, -1 to 1",
    "wi": "unit vector to the light",
    "wo": "unit vector to the viewer",
    "curvature": "of the cloth in the viewer's plane, 1/yarn spacings, 0 to 1; 0 with the viewer behind",
}
"""Fields of a query."""

OUTPUTS: Final = {
    "components": "specular warp and weft, diffuse warp and weft, for unit colours, in 1/sr",
    "bounds": "with light and viewer on one side the same without shadows of the light, never below the components, of "
    "which the diffuse ones integrate to at most 1; else the components",
}
"""Fields of an answer."""

CONVENTIONS: Final = [
    "The cloth is the plane z = 0, its front towards z > 0. Warp yarns run along y, weft yarns along x.",
    "Lengths are in yarn spacings. The first end and pick of the draft lie in the cell from (0, 0) to (1, 1).",
    "wi and wo point away from the cloth. Behind it (z < 0) answers are 0 unless `kinds` has `behind`.",
    "The incident cosine is in the components: radiance is the integral of f L over wi, with no further cosine.",
    "f = k_s,warp S_warp + k_s,weft S_weft + k_d,warp C_warp + k_d,weft C_weft, with k_dt in place of k_d where "
    "light and viewer are on different sides.",
]
"""Axes, directions, cosine and colours."""


class Descriptor(Frozen, use_attribute_docstrings=True):
    """Content of `soft_nodes.json`."""

    model: str = "soft_nodes"
    """The method."""
    fabric: str
    """Name of the fabric."""
    generator: str = f"twillight {version('twillight')}"
    """Program and version."""
    level: int | None = None
    """Level of detail k of the soft nodes; none if the model has none."""
    inputs: dict[str, str] = INPUTS
    """Fields of a query, with their units."""
    outputs: dict[str, str] = OUTPUTS
    """Fields of an answer."""
    conventions: list[str] = CONVENTIONS
    """Axes, directions, cosine and colours."""
    components: tuple[str, ...] = COMPONENTS
    """Order of the four components."""
    colours: dict[str, list[float]]
    """Colours of the yarns."""
    repeat: tuple[int, int]
    """Ends and picks after which the weave repeats."""
    threads: tuple[int, int]
    """Ends and picks after which their colours repeat; 1 and 1 if they do not differ."""
    limits: dict[str, int]
    """Largest table that the shader takes."""
    texture_width: int = TEXTURE_WIDTH
    """Texels of a row of every texture."""
    kinds: list[str] = Field(default_factory=list)
    """Kinds of queries that the tables know, beside light and viewer in front of flat cloth."""
    scalars: dict[str, int | float] = Field(default_factory=dict)
    """First elements of `integers` (whole numbers) and of `numbers`, in this order."""
    back_scalars: dict[str, int | float] = Field(default_factory=dict)
    """The next ones of both, of the back of the cloth, if the tables know it."""
    buffers: dict[str, Buffer]
    """Buffers, by the name that they have in the source."""
    network: Networks | None = None
    """Networks, of a model that has some."""
    source: list[str] = Field(default_factory=list)
    """Files of the source."""
    languages: dict[str, list[str]] = Field(default_factory=dict)
    """Files that slangc made, by language."""
    golden: str = GOLDEN
    """Queries with their answers."""
    files: dict[str, str] = Field(default_factory=dict)
    """SHA-256 of every file, by path; that of this file is of its other keys."""


class Shader(NamedTuple):
    """A model of one fabric, ready to be written.

    `sources` are files of the source that are the same for all fabrics, `generated` texts of the others by name,
    `files` contents of buffers by path in the folder. `about` has no source and languages yet; its `model` is the name
    of a file and a function of the source. `size` are words for a sentence; `sampled` says whether directions can be
    drawn; `onnx` returns the network as an ONNX model, if there is one; `threads`, whether threads have their colours.
    """

    sources: tuple[str, ...]
    generated: dict[str, str]
    files: dict[str, bytes]
    about: Descriptor
    golden: Golden
    size: str
    sampled: bool
    onnx: Callable[[], bytes] | None = None
    threads: bool = False


def colours(fabric: Fabric) -> dict[str, list[float]]:
    """Return linear Rec. 709 colours of the yarns: k_s, k_d, and k_dt in its place with light from the other side.

    Means if threads differ in colour, as `threads` says; the array `tints` has the factors of each.
    """
    names = [f"{kind}_{yarn}" for kind in ("specular", "diffuse", "transmitted") for yarn in ("warp", "weft")]
    rows = (*linear_colours(fabric), *linear_colours(fabric, transmitted=True)[2:])
    return {name: row.tolist() for name, row in zip(names, rows, strict=True)}


def vectors(golden: Golden) -> dict[str, Any]:
    """Return the content of `golden.json`.

    `columns` names those of `queries`; `groups` has first row and end of each kind, and the range of a column is that
    of its group. `components` and `bounds` are the answers, `colour` is the patch BSDF in linear RGB; `transparency`,
    and `density` of wi in 1/sr, are empty for a model without them. `steady` is the share of the queries tried whose
    answer does not hang on the last digit of a place; the others are not listed.
    """
    whole = golden.answers.shape[1] > DENSITY_COLUMN
    return {
        "columns": GOLDEN_COLUMNS,
        "queries": _short(golden.rows),
        "groups": golden.groups,
        "components": _short(golden.answers[:, :4]),
        "bounds": _short(golden.answers[:, 4:8]),
        "colour": _short(golden.answers[:, COLOUR]),
        "transparency": _short(golden.answers[:, TRANSPARENCY_COLUMN]) if whole else [],
        "density": _short(golden.answers[:, DENSITY_COLUMN]) if whole else [],
        "steady": golden.steady,
    }


def _short(values: Float32) -> list[Any]:
    """Return numbers of single precision with the fewest digits that tell all of them apart."""
    # `str` keeps to NumPy's print options, which other packages change.
    numbers = [float(np.format_float_scientific(value, unique=True)) for value in values.ravel()]
    return list(np.array(numbers).reshape(values.shape).tolist())
