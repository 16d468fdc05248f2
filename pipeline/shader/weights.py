"""The buffer `weights`: layers and textures of networks, in elements of four numbers.

A layer has its biases first, then its weights row after row, one row an input. Rows are filled up with zeros to whole
elements, and inputs to a multiple of four, so that the shader multiplies vectors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from pipeline.compiled.arrays import Float32
from pipeline.models.networks.perceptron import Layer
from pipeline.shader import descriptor as said
from pipeline.shader.constants import TEXTURE_WIDTH
from pipeline.shader.limits import MOST_HEIGHT
from weaves.errors import BadInput

MOST_ELEMENTS: Final = TEXTURE_WIDTH * MOST_HEIGHT
"""Most elements of the buffer: of a texture that every WebGL 2 allows."""


def quads(count: int) -> int:
    """Return how many elements of four hold so many numbers."""
    return -(-count // 4)


class Weights:
    """Arrays, one after another, that fill whole elements."""

    def __init__(self) -> None:
        self._parts: list[Float32] = []
        self.count = 0
        self.places: dict[str, said.Place] = {}

    def add(self, name: str, values: Float32, meaning: str) -> said.Place:
        """Append an array whose last axis is filled up to whole elements, and return its place."""
        width = 4 * quads(values.shape[-1])
        filled = np.zeros((*values.shape[:-1], width), np.float32)
        filled[..., : values.shape[-1]] = values
        place = said.Place(offset=self.count, shape=filled.shape, meaning=meaning)
        self._parts.append(filled.ravel())
        self.count += filled.size // 4
        self.places[name] = place
        return place

    def add_perceptron(self, network: str, layers: Sequence[Layer], activation: str, last: str) -> list[said.Layer]:
        """Append the layers of a network; inputs of the first one are filled up to whole elements.

        Parameters
        ----------
        network : str
            Name of the network.
        layers : sequence of Layer
            From the first to the last one.
        activation, last : str
            Functions of the outputs of all layers but the last, and of the last.
        """
        found = []
        for index, layer in enumerate(layers):
            rows = np.zeros((4 * quads(len(layer.weights)), layer.weights.shape[1]), np.float32)
            rows[: len(layer.weights)] = layer.weights
            name = f"{network} {index}"
            found.append(
                said.Layer(
                    network=network,
                    biases=self.add(f"{name} biases", layer.biases, "biases"),
                    weights=self.add(f"{name} weights", rows, "weights (inputs, outputs)"),
                    activation=last if index == len(layers) - 1 else activation,
                )
            )
        return found

    def buffer(self) -> said.Buffer:
        """Return the description of the buffer."""
        return said.Buffer(
            files={"float32": "tables/weights.f32", "float16": "tables/weights.f16"},
            channels=4,
            elements=self.count,
            arrays=self.places,
        )

    @property
    def values(self) -> Float32:
        """All numbers of the buffer."""
        return np.concatenate(self._parts)

    def files(self) -> dict[str, bytes]:
        """Return its files, by their paths; BadInput for more than MOST_ELEMENTS."""
        if self.count > MOST_ELEMENTS:
            allowed = f"the shader takes at most {MOST_ELEMENTS:,} elements of weights"
            raise BadInput("export", "--shader", f"{self.count:,} elements", allowed)
        return {
            "tables/weights.f32": self.values.astype("<f4").tobytes(),
            "tables/weights.f16": self.values.astype("<f2").tobytes(),
        }
