"""Contents of an exported folder."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from pipeline.shader.descriptor import Descriptor
from pipeline.shader.golden import Golden


class Shader(NamedTuple):
    """A model of one fabric, ready to be written.

    Attributes
    ----------
    name : str
        Name of the model, of its file in the source, and of its function there.
    sources : tuple of str
        Files of the source that are the same for all fabrics.
    generated : dict
        Texts of the other files of the source, by name.
    files : dict
        Contents of the files of buffers, by their paths in the folder.
    said : Descriptor
        The descriptor, before source and languages are written.
    golden : Golden
        Queries with their answers.
    size : str
        Words on its size, for a sentence.
    sampled : bool
        Whether directions can be drawn.
    onnx : callable or None
        Returns its network as an ONNX model; None if it has none.
    """

    name: str
    sources: tuple[str, ...]
    generated: dict[str, str]
    files: dict[str, bytes]
    said: Descriptor
    golden: Golden
    size: str
    sampled: bool
    onnx: Callable[[], bytes] | None = None
