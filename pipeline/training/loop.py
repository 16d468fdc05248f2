"""The one training loop, for every model that learns.

A step: take the batch that (seed, step) names, set the rate, let the model adjust its schedule, descend. Every N
steps all state goes into a checkpoint, written whole or not at all; nothing else is remembered, so that a training
that was killed gives, on the CPU, the same bits as one that was not. The files say nothing of when and where they
were made.
"""

from __future__ import annotations

import json
import math
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from torch import Tensor, nn

from pipeline.atomic import atomic_path, atomic_write
from pipeline.fingerprint import fingerprint
from pipeline.models.options import VERSIONS, NeumipOptions, WovenOptions
from pipeline.models.registry import CARD, WEIGHTS, module_of
from pipeline.shards.manifest import Manifest
from pipeline.training.dataset import Batches, Order, load_rows
from pipeline.training.options import VERSION, TrainingOptions
from pipeline.training.validation import validation_figures
from weaves.errors import BadInput, WorkFailed, nearest

CHECKPOINT = "checkpoint.pt"
ROWS = "rows.npy"

_DIVERGED = 100.0  # times the first losses
_START_ROWS = 65_536  # rows whose mean the last bias starts at


def train(
    options: WovenOptions | NeumipOptions,
    training: TrainingOptions,
    manifest_folder: Path,
    fabrics: Sequence[str],
    folder: Path,
    progress: Callable[[float], None] = lambda fraction: None,
) -> None:
    """Train a model and write ``model.safetensors`` and ``card.json``.

    Parameters
    ----------
    options : WovenOptions or NeumipOptions
        The model.
    training : TrainingOptions
        How it is trained.
    manifest_folder : Path
        The data set.
    fabrics : sequence of str
        Names of the fabrics whose training rows it learns from; one for a model of one material.
    folder : Path
        Where the files go. A checkpoint of the same training in it is gone on from; of another one, ignored.
    progress : callable
        Called with the finished share, in [0, 1].

    Raises
    ------
    BadInput
        If rows are missing, the folder cannot be written, or a GPU is asked for that is not there.
    WorkFailed
        If the loss diverges; the last good checkpoint stays.
    """
    device = chosen_device(training.device)
    manifest = Manifest.load(manifest_folder)
    for name in fabrics:
        if name not in manifest.fabrics:
            raise BadInput(str(manifest_folder), "fabric", name, nearest(name, manifest.fabrics))
    members = [manifest.fabrics[name] for name in fabrics]
    identity = _identity(options, training, manifest, fabrics)
    with _reproducible(training.threads, device):
        rows = load_rows(manifest, manifest_folder, fabrics, folder / f"{identity}-{ROWS}")
        order = Order(rows.counts, training.batch, training.fabrics, training.seed)
        batches = Batches(rows, order, device)

        # Build the network; its last bias starts at the mean of a spread of targets.
        torch.manual_seed(training.seed)
        network: Any = module_of(options.model).build(options, members)
        stride = max(len(rows.table) // _START_ROWS, 1)
        network.start_at(torch.from_numpy(rows.table[::stride, 9:].copy()))
        network.to(device).train()
        optimiser = torch.optim.AdamW(
            network.parameter_groups(training.learning_rate), weight_decay=training.weight_decay, fused=True
        )
        peaks = [group["lr"] for group in optimiser.param_groups]

        # Go on from the last checkpoint of this very training.
        state = _State(network, optimiser, identity, folder / CHECKPOINT)
        first = state.restore(device)
        interval = math.ceil(training.steps / training.curve_points)
        for step in range(first, training.steps):
            factor = rate_factor(step, training)
            for group, peak in zip(optimiser.param_groups, peaks, strict=True):
                group["lr"] = factor * peak
            network.schedule(step / training.steps)
            loss = network.loss(batches.step(step), order.random(step))
            optimiser.zero_grad()
            loss.backward()
            norm = nn.utils.clip_grad_norm_(network.parameters(), training.gradient_clip)
            optimiser.step()

            # Note the loss; look at it only now and then, because looking waits for the device.
            state.add(loss.detach(), norm)
            done = step + 1
            if done % interval == 0 or done == training.steps:
                state.mark(done)
            if done % training.checkpoint_every == 0 and done < training.steps:
                state.save(done)
            if done % max(training.steps // 200, 1) == 0:
                progress(done / training.steps)
        state.check(training.steps)

        weights = {name: tensor.cpu().contiguous() for name, tensor in network.state_dict().items()}
        card = _card(options, training, manifest, fabrics) | {
            "architecture": network.architecture(),
            "curve": [{"step": step, "loss": loss} for step, loss in state.curve],
        }
        card["validation"] = validation_figures(options, card, weights, manifest, manifest_folder, training)
    # One key of metadata: safetensors writes several in no fixed order.
    metadata = {"twillight": json.dumps({"model": options.model, "name": options.name, "identity": identity})}
    atomic_write(folder / WEIGHTS, safetensors.torch.save(weights, metadata=metadata))
    atomic_write(folder / CARD, json.dumps(card, indent=1, sort_keys=True).encode() + b"\n")
    (folder / CHECKPOINT).unlink(missing_ok=True)
    (folder / f"{identity}-{ROWS}").unlink(missing_ok=True)
    progress(1.0)


def rate_factor(step: int, training: TrainingOptions) -> float:
    """Return the learning rate of a step as a share of its peak: linear up, then half a cosine down to 0."""
    warm = round(training.warm_up * training.steps)
    if step < warm:
        return (step + 1) / (warm + 1)
    return 0.5 * (1.0 + math.cos(math.pi * (step - warm) / max(training.steps - warm, 1)))


def chosen_device(name: str) -> torch.device:
    """Return the device asked for; BadInput if it is a GPU and there is none."""
    present = torch.cuda.is_available()
    if name == "cuda" and not present:
        raise BadInput("training", "device", name, "torch finds no GPU here; allowed: auto, cpu")
    return torch.device("cuda" if present and name != "cpu" else "cpu")


class _State:
    """What a checkpoint holds: weights, optimiser, step, and the losses so far."""

    def __init__(self, network: nn.Module, optimiser: torch.optim.Optimizer, identity: str, path: Path) -> None:
        self.network, self.optimiser, self.identity, self.path = network, optimiser, identity, path
        self.curve: list[tuple[int, float]] = []
        self._sums = torch.zeros(2, dtype=torch.float64)  # losses and gradient norms since the last mark
        self._since = 0

    def add(self, loss: Tensor, norm: Tensor) -> None:
        self._sums = self._sums.to(loss.device) + torch.stack([loss, norm]).to(torch.float64)
        self._since += 1

    def mark(self, step: int) -> None:
        """Put the mean loss since the last mark on the curve."""
        self.check(step)
        self.curve.append((step, round(float(self._sums[0]) / self._since, 9)))
        self._sums, self._since = torch.zeros_like(self._sums), 0
        self.check(step)

    def check(self, step: int) -> None:
        """Stop a training that has left the finite numbers or its own beginnings."""
        finite = bool(self._sums.isfinite().all())
        if finite and (len(self.curve) < 2 or self.curve[-1][1] <= _DIVERGED * self.curve[0][1]):
            return
        kept = f"; the checkpoint before is kept in {self.path}" if self.path.exists() else ""
        raise WorkFailed(f"the training loss diverged by step {step}: try a lower learning_rate{kept}")

    def save(self, step: int) -> None:
        self.check(step)
        content = {
            "identity": self.identity,
            "step": step,
            "network": self.network.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "curve": self.curve,
            "sums": self._sums,
            "since": self._since,
        }
        with atomic_path(self.path) as temporary:
            torch.save(content, temporary)

    def restore(self, device: torch.device) -> int:
        """Load the checkpoint if it is one of this training; return the step to go on with."""
        try:
            content = torch.load(self.path, map_location=device, weights_only=True)
        except (OSError, RuntimeError, ValueError, EOFError, pickle.UnpicklingError):
            return 0
        if content["identity"] != self.identity:
            return 0
        self.network.load_state_dict(content["network"])
        self.optimiser.load_state_dict(content["optimiser"])
        self.curve = [(int(step), float(loss)) for step, loss in content["curve"]]
        self._sums, self._since = content["sums"], int(content["since"])
        return int(content["step"])


@contextmanager
def _reproducible(threads: int, device: torch.device) -> Iterator[None]:
    """Fix the threads, and on the CPU the algorithms, within."""
    before = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    torch.set_num_threads(threads)
    if device.type == "cpu":
        torch.use_deterministic_algorithms(True)
    try:
        yield
    finally:
        torch.set_num_threads(before[0])
        torch.use_deterministic_algorithms(before[1])


def _identity(options: Any, training: TrainingOptions, manifest: Manifest, fabrics: Sequence[str]) -> str:
    """Fingerprint everything that shapes the weights."""
    return fingerprint(_card(options, training, manifest, fabrics))


def _card(options: Any, training: TrainingOptions, manifest: Manifest, fabrics: Sequence[str]) -> dict[str, Any]:
    """Return the part of the card that is known before the training."""
    return {
        "model": options.model,
        "name": options.name,
        "version": {"model": VERSIONS[options.model], "training": VERSION},
        "options": options.model_dump(mode="json"),
        "training": training.model_dump(mode="json", exclude={"device", "checkpoint_every"}),
        "dataset": {"name": manifest.name, "fingerprint": manifest.fingerprint},
        "fabrics": [
            {
                "name": name,
                "optics": fingerprint(manifest.fabrics[name].optics()),
                "repeat": list(manifest.fabrics[name].weave.repeat),
            }
            for name in fabrics
        ],
    }
