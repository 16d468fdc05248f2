"""The one training loop, for every model that learns.

A step: take the batch that (seed, step) names, set the rate, let the model adjust its schedule, descend, average the
weights. Every N steps all state goes into a checkpoint; nothing else is remembered, so that a training that was killed
gives, on the CPU, the same bits as one that was not. Now and then the averaged weights answer held-out queries. The
state whose loss there is the lowest is shipped; a model whose own error has sunk below the truth's noise has nothing
more to learn from it and stops. The files say nothing of when and where they were made.
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import safetensors.torch
import torch
from torch import nn

from pipeline import versions
from pipeline.fingerprint import IDENTITY, fingerprint
from pipeline.models.card import write_model
from pipeline.models.catalogue import ModelOptions
from pipeline.models.domain import Domain
from pipeline.models.registry import build_network
from pipeline.shards.generate import set_name
from pipeline.shards.manifest import Manifest
from pipeline.training.checkpoint import CHECKPOINT, State
from pipeline.training.dataset import TARGET, Order, TrainingRows
from pipeline.training.options import TrainingOptions
from pipeline.training.validation import HeldOut
from weaves.errors import BadInput, nearest
from weaves.fabric import Fabric

_START_ROWS = 65_536  # rows whose mean the last bias starts at
_WATCH = 2**40  # a step that no training has: it names the random numbers of the held-out loss


def train(
    options: ModelOptions,
    training: TrainingOptions,
    manifest_folder: Path,
    fabrics: Sequence[str],
    folder: Path,
    progress: Callable[[float], None] = lambda fraction: None,
) -> None:
    """Train a model that learns, and write ``model.safetensors`` and ``card.json`` to `folder`.

    `fabrics` are the names of those of the data set whose training rows it learns from; one for a model of one
    material. A checkpoint of the same training in the folder is gone on from; one of another is ignored. `progress`
    receives the finished share.

    BadInput if rows are missing, the folder cannot be written, or a requested GPU is missing. WorkFailed if the loss
    diverges, or the code of a network from outside fails; the last good checkpoint stays.
    """
    device = _chosen_device(training.device)
    manifest = Manifest.load(manifest_folder)
    if missing := [name for name in fabrics if name not in manifest.fabrics]:
        raise BadInput(str(manifest_folder), "fabric", missing[0], nearest(missing[0], manifest.fabrics))
    members = [manifest.fabrics[name] for name in fabrics]
    card = _card(options, training, manifest, members)
    identity = fingerprint(card)  # of everything that shapes the weights
    with _reproducible(training.threads, device):
        rows = TrainingRows(manifest, manifest_folder, fabrics, device)
        order = Order(rows.windows, training.batch, training.fabrics, training.seed)

        # Build the network; its last bias starts at the mean of a spread of targets.
        torch.manual_seed(training.seed)
        sets = [set_name(rows) for rows in options.extra_rows]
        extra = ([manifest.columns(manifest_folder, name, own) for name in fabrics] for own in sets)
        network = build_network(options, members, extra)
        network.start_at(rows.spread(_START_ROWS)[:, TARGET].cpu().contiguous())
        network.to(device).train()
        groups = network.parameter_groups(training.learning_rate)
        optimiser = torch.optim.AdamW(groups, weight_decay=training.weight_decay, fused=True)
        peaks = [group["lr"] for group in optimiser.param_groups]
        learnt = torch.compile(network.loss) if training.compile else network.loss
        card["architecture"] = network.architecture()
        held_out = HeldOut(options, card, manifest, manifest_folder, training.validation_rows)
        watched = held_out.batch(device)

        # Go on from the last checkpoint of this very training.
        state = State(network, optimiser, training.average, identity, folder / CHECKPOINT)
        first = state.restore(device)
        interval = math.ceil(training.steps / training.curve_points)
        looks = math.ceil(training.curve_points / training.held_out_points) * interval
        for step in range(first, training.steps):
            for group, peak in zip(optimiser.param_groups, peaks, strict=True):
                group["lr"] = rate_factor(step, training) * peak
            network.schedule(step / training.steps)
            batch, random = rows.batch(*order.step(step)), order.random(step)
            with network.call("loss"):
                with torch.autocast(device.type, torch.bfloat16, enabled=mixed(training, device)):
                    loss = learnt(batch, random)
                optimiser.zero_grad()
                loss.backward()
                norm = nn.utils.clip_grad_norm_(network.parameters(), training.gradient_clip)
                optimiser.step()

            # Note the loss; look at it only now and then, because looking waits for the device.
            state.add(step, loss.detach(), norm)
            done = step + 1
            if done % interval == 0 or done == training.steps:
                state.mark(done)
            if watched is not None and (done % looks == 0 or done == training.steps):
                with state.averaged(), network.call("loss"):
                    held_out_loss = float(network.loss(watched, order.random(_WATCH)))
                state.offer(done, held_out_loss)
                error, noise = held_out.error_and_noise(state.weights())
                figures = {"held_out_loss": held_out_loss, "held_out_mse": error, "held_out_noise": noise}
                state.curve[-1] |= {name: float(f"{value:.6g}") for name, value in figures.items()}
                if training.stop_at_noise and error <= 2.0 * noise:
                    break
            if done % training.checkpoint_every == 0 and done < training.steps:
                state.save(done)
            if done % max(training.steps // 200, 1) == 0:
                progress(done / training.steps)
        state.check(training.steps)

        weights = state.weights(best=True)
        card |= {"curve": state.curve, "steps_taken": int(state.curve[-1]["step"]), "kept": _kept(state)}
        # Beside the options; the number of cores is not part of it.
        processor = torch.backends.cpu.get_cpu_capability()
        card["last_bits"] = {"torch": torch.__version__, "processor": processor, "device": device.type}
        card["validation"] = held_out.figures(weights)
    # One key of metadata: safetensors writes several in no fixed order.
    metadata = {"twillight": json.dumps({"model": card["model"], "name": card["name"], "identity": identity})}
    write_model(folder, safetensors.torch.save(weights, metadata=metadata), card)
    (folder / CHECKPOINT).unlink(missing_ok=True)
    progress(1.0)


def _kept(state: State) -> dict[str, Any]:
    """Describe which weights are shipped, and the figure that chose them."""
    if not state.best:
        return {"weights": "running average of the last step", "watched": "nothing: there are no held-out queries"}
    watched = "held_out_loss: the loss of the training on held-out queries of the fabrics it learns from"
    return {"weights": "running average of the step with the lowest held_out_loss", "watched": watched, **state.best}


def rate_factor(step: int, training: TrainingOptions) -> float:
    """Return the learning rate of a step as a share of its peak: linear up, then half a cosine down to 0."""
    warm = round(training.warm_up * training.steps)
    if step < warm:
        return (step + 1) / (warm + 1)
    return 0.5 * (1.0 + math.cos(math.pi * (step - warm) / max(training.steps - warm, 1)))


def _chosen_device(name: str) -> torch.device:
    """Return the requested device; BadInput if it is a GPU and there is none."""
    present = torch.cuda.is_available()
    if name == "cuda" and not present:
        raise BadInput("training", "device", name, "torch finds no GPU here; allowed: auto, cpu")
    return torch.device("cuda" if present and name != "cpu" else "cpu")


def mixed(training: TrainingOptions, device: torch.device) -> bool:
    """Return whether a training multiplies in bfloat16: on a GPU, unless this is switched off."""
    return training.precision == "mixed" or (training.precision == "auto" and device.type == "cuda")


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


def _card(options: Any, training: TrainingOptions, manifest: Manifest, fabrics: Sequence[Fabric]) -> dict[str, Any]:
    """Return the part of the card that is known before the training."""
    return {
        "model": options.model,
        "name": options.name,
        "domain": Domain.of(manifest.about, fabrics).model_dump(mode="json"),
        "version": {"model": options.version, "training": versions.TRAINING},
        "options": options.model_dump(mode="json", context=IDENTITY),
        "training": training.model_dump(mode="json", context=IDENTITY, exclude={"device", "checkpoint_every"}),
        "dataset": {"name": manifest.name, "fingerprint": manifest.fingerprint},
        "fabrics": [
            {"name": fabric.name, "optics": fingerprint(fabric.optics()), "repeat": list(fabric.weave.repeat)}
            for fabric in fabrics
        ],
    }
