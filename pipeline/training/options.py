"""How a model is trained: everything that shapes the resulting bytes, and where it runs.

The learning rate warms up linearly and then falls to zero along half a cosine. Nothing heavy is imported here.
"""

from typing import ClassVar, Literal

from pydantic import Field

from pipeline.models.options import Design


class TrainingOptions(Design):
    """One training run; `device` and `threads` choose where, the rest decides the numbers."""

    fixed: ClassVar[tuple[str, ...]] = ("weight_decay", "gradient_clip", "held_out_points")

    steps: int = Field(default=7000, ge=1, le=10_000_000)
    """Optimiser steps."""
    batch: int = Field(default=1024, ge=1, le=2**22)
    """Queries a step, over all fabrics of the step."""
    fabrics: int = Field(default=8, ge=1, le=4096)
    """Fabrics a step; a model of many fabrics encodes each once and evaluates batch / fabrics queries of it."""
    learning_rate: float = Field(default=4e-3, gt=0, le=1)
    """Peak learning rate of AdamW."""
    warm_up: float = Field(default=0.03, ge=0, le=0.5)
    """Share of the steps in which the rate rises linearly."""
    average: float = Field(default=0.998, ge=0, lt=1)
    """Share of the exponential moving average of the weights that a step keeps; the average is what is shipped. 0: the
    last weights are."""
    precision: Literal["auto", "single", "mixed"] = "auto"
    """`mixed` multiplies in bfloat16 and sums in single precision; `auto` does so on a GPU only."""
    compile: bool = False
    """Compile the loss with torch.compile: minutes at first, faster steps on a GPU; the last bits change."""
    stop_at_noise: bool = True
    """Stop once the model's own squared error on held-out queries is below the noise of the truth there."""
    seed: int = Field(default=0, ge=0, lt=2**63)
    """Seed of the initial weights and of the order of the queries."""
    threads: int = Field(default=1, ge=1, le=1024)
    """Threads torch may use; sums are split among them, so the last bits depend on it."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where the training runs; `auto` takes a GPU when there is one. Only the CPU promises the same bits."""
    checkpoint_every: int = Field(default=500, ge=1, le=10_000_000)
    """Steps between checkpoints, from which an interrupted training goes on."""
    curve_points: int = Field(default=40, ge=1, le=10_000)
    """Points of the loss curve on the model card."""
    validation_rows: int = Field(default=16_384, ge=1, le=2**24)
    """Most held-out queries used for the figures on the model card."""

    weight_decay: ClassVar[float] = 0.0
    """Decoupled weight decay of AdamW."""
    gradient_clip: ClassVar[float] = 1.0
    """Largest Euclidean norm of the gradient."""
    held_out_points: ClassVar[int] = 8
    """Looks at held-out queries along the curve."""
