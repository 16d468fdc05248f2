"""Training of networks of an encoder and a decoder: one learning rate for all weights, no schedule."""

from __future__ import annotations

from typing import Any

from torch import nn


class EncoderDecoder(nn.Module):
    """A network of two parts, which subclasses create.

    Attributes
    ----------
    encoder : nn.Module
        Runs once a fabric.
    decoder : nn.Module
        Runs for every query; all that a renderer keeps beside what was encoded.
    """

    encoder: nn.Module
    decoder: nn.Module

    def schedule(self, progress: float) -> None:
        """Change nothing over the training."""

    def parameter_groups(self, rate: float) -> list[dict[str, Any]]:
        """Return one group: all weights learn at the same rate."""
        return [{"params": list(self.parameters()), "lr": rate}]

    def architecture(self) -> dict[str, Any]:
        """Count parameters and name the layers."""
        counts = {
            part: sum(weight.numel() for weight in module.parameters())
            for part, module in (("encoder", self.encoder), ("decoder", self.decoder))
        }
        layers = {name: list(weight.shape) for name, weight in self.named_parameters()}
        return {"parameters": counts | {"total": sum(counts.values())}, "layers": layers}
