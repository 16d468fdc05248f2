"""`btf_autoencoder`: an autoencoder for each fabric [Rainer2019Neural]; its options."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from pipeline.models.unified_btf import BtfOptions


class BtfAutoencoderOptions(BtfOptions):
    """One autoencoder of angular samples for each fabric [Rainer2019Neural]."""

    of_one_material: ClassVar[bool] = True
    seconds: ClassVar[tuple[float, float]] = (1.5e-5, 1.5e-6)

    model: Literal["btf_autoencoder"] = "btf_autoencoder"
    latent: int = Field(default=8, ge=1, le=512)

    @property
    def departures(self) -> tuple[str, ...]:
        """Deviations from the published method, for the page."""
        return ("four components in place of RGB, in samples and answers", "the encoder of 2020")
