"""Checkpoints of a training, written atomically: tensors and JSON, with a hash over both, never executable content."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import safetensors
import safetensors.torch
import torch
from safetensors import SafetensorError
from torch import Tensor, nn
from torch.optim import Optimizer

from pipeline.atomic import atomic_path
from weaves.errors import WorkFailed
from weaves.reading import refuse_irregular

CHECKPOINT: Final = "checkpoint.safetensors"

_DIVERGED = 100.0  # times the first losses
_KEY: Final = "twillight"


class State:
    """Weights, their running average, its best state, the optimiser, the step, and the losses so far.

    `average` is the share of the running average of the weights kept at a step; it is less in the first steps, which no
    average should remember; with 0 the average is the weights. `identity` is the fingerprint of everything that shapes
    the weights: a checkpoint of another training, at `path`, is not gone on from.
    """

    def __init__(self, network: nn.Module, optimiser: Optimizer, average: float, identity: str, path: Path) -> None:
        self.network, self.optimiser, self.identity, self.path = network, optimiser, identity, path
        self.curve: list[dict[str, float]] = []
        self._keep = average
        self._learning = [tensor for tensor in network.state_dict().values() if tensor.is_floating_point()]
        self._average = [tensor.clone() for tensor in self._learning]
        self.best: dict[str, float] = {}  # step and held-out loss of the best state that was looked at
        self._best = [tensor.clone() for tensor in self._average]
        self._sums = torch.zeros(2, dtype=torch.float64)  # losses and gradient norms since the last mark
        self._since = 0

    def add(self, step: int, loss: Tensor, norm: Tensor) -> None:
        """Note a step's loss and gradient norm, and average its weights."""
        self._sums = self._sums.to(loss.device) + torch.stack([loss, norm]).to(torch.float64)
        self._since += 1
        keep = min(self._keep, (1.0 + step) / (10.0 + step))
        with torch.no_grad():
            torch._foreach_lerp_(self._average, self._learning, 1.0 - keep if self._keep > 0.0 else 1.0)

    def mark(self, step: int) -> None:
        """Put the mean loss since the last mark on the curve."""
        self.check(step)
        self.curve.append({"step": step, "loss": round(float(self._sums[0]) / self._since, 9)})
        self._sums, self._since = torch.zeros_like(self._sums), 0
        self.check(step)

    def check(self, step: int) -> None:
        """Stop a training that has left the finite numbers or its own beginnings."""
        finite = bool(self._sums.isfinite().all())
        if finite and (len(self.curve) < 2 or self.curve[-1]["loss"] <= _DIVERGED * self.curve[0]["loss"]):
            return
        kept = f"; the checkpoint before is kept in {self.path}" if self.path.exists() else ""
        raise WorkFailed(f"the training loss diverged by step {step}: try a lower learning_rate{kept}")

    @contextmanager
    def averaged(self) -> Iterator[None]:
        """Give the network its averaged weights within, without gradients."""
        own = [tensor.clone() for tensor in self._learning]
        with torch.no_grad():
            torch._foreach_copy_(self._learning, self._average)
            try:
                yield
            finally:
                torch._foreach_copy_(self._learning, own)

    def offer(self, step: int, loss: float) -> None:
        """Keep the averaged weights if their held-out loss is the lowest so far."""
        if not self.best or loss < self.best["held_out_loss"]:
            self.best = {"step": step, "held_out_loss": loss}
            torch._foreach_copy_(self._best, self._average)

    def weights(self, best: bool = False) -> dict[str, Tensor]:
        """Return the averaged weights on the CPU: the last, or the `best` if held-out queries were looked at."""
        averaged = iter(self._best if best and self.best else self._average)
        return {
            name: (next(averaged) if tensor.is_floating_point() else tensor).detach().cpu().contiguous().clone()
            for name, tensor in self.network.state_dict().items()
        }

    def save(self, step: int) -> None:
        """Write the checkpoint of a step; WorkFailed if the training has diverged."""
        self.check(step)
        tensors = {f"network/{name}": tensor for name, tensor in self.network.state_dict().items()}
        tensors |= {f"average/{index}": tensor for index, tensor in enumerate(self._average)}
        tensors |= {f"best/{index}": tensor for index, tensor in enumerate(self._best)}
        for index, entries in self.optimiser.state_dict()["state"].items():
            tensors |= {f"optimiser/{index}/{name}": torch.as_tensor(value) for name, value in entries.items()}
        tensors["sums"] = self._sums
        about = {"identity": self.identity, "step": step, "curve": self.curve, "since": self._since, "best": self.best}
        with atomic_path(self.path) as temporary:
            copies = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
            about["sha256"] = _sha256(about, copies)
            safetensors.torch.save_file(copies, temporary, metadata={_KEY: json.dumps(about)})

    def restore(self, device: torch.device) -> int:
        """Load the checkpoint if it is one of this training; return the step to go on with."""
        content = read_checkpoint(self.path)
        if content is None or content[0].get("identity") != self.identity:
            return 0
        about, tensors = content
        network = {name: tensors[f"network/{name}"] for name in self.network.state_dict()}
        self.network.load_state_dict(network)
        moments: dict[int, dict[str, Tensor]] = {}
        for name, tensor in tensors.items():
            if name.startswith("optimiser/"):
                _, parameter, entry = name.split("/")
                moments.setdefault(int(parameter), {})[entry] = tensor
        self.optimiser.load_state_dict({"state": moments, "param_groups": self.optimiser.state_dict()["param_groups"]})
        with torch.no_grad():
            for index, average in enumerate(self._average):
                average.copy_(tensors[f"average/{index}"])
                self._best[index].copy_(tensors[f"best/{index}"])
        self.curve, self.best = about["curve"], about["best"]
        self._sums, self._since = tensors["sums"].to(device), int(about["since"])
        return int(about["step"])


def read_checkpoint(path: Path) -> tuple[dict[str, Any], dict[str, Tensor]] | None:
    """Return what a checkpoint says of itself and its tensors; None if there is none or it is damaged."""
    try:
        refuse_irregular(path, "a checkpoint")
        with safetensors.safe_open(path, framework="pt") as file:
            about = json.loads((file.metadata() or {})[_KEY])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        return (about, tensors) if about.pop("sha256") == _sha256(about, tensors) else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RuntimeError, SafetensorError):
        return None


def _sha256(about: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> str:
    """Return the hash of a checkpoint: of what it says of itself, and of each tensor's name, type, shape and bytes."""
    digest = hashlib.sha256(json.dumps(about, sort_keys=True).encode())
    for name, tensor in sorted(tensors.items()):
        digest.update(f"\n{name} {tensor.dtype} {list(tensor.shape)}\n".encode())
        digest.update(tensor.reshape(-1).view(torch.uint8).numpy().data)
    return digest.hexdigest()
