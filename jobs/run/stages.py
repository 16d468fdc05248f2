"""Which function does the tasks of which stage: the only place where work and its scheduling meet.

The functions run in worker processes. What they need is imported inside them, so that planning loads no heavy library.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from jobs.plan.task import Stage, Task
from jobs.run.ledger import link

Progress = Callable[[float], None]


def run(task: Task, out: Path, progress: Progress) -> None:
    """Do a task; its products then lie in `out`."""
    RUNNERS[task.stage](task, out, progress)


def _generate(task: Task, out: Path, progress: Progress) -> None:
    from pipeline.shards.generate import SHARD_TASK, generate_shard

    question = SHARD_TASK.validate_python(task.setting["question"])
    first, *others = (out / path for path in task.products)
    generate_shard(question, first, progress)
    for other in others:  # of other data sets that hold it
        link(first, other)


def _train(task: Task, out: Path, progress: Progress) -> None:
    from pipeline.training.loop import train
    from pipeline.training.options import TrainingOptions

    options = model_options(task.spec["options"])
    training = TrainingOptions.model_validate(task.setting["training"])
    folder = (out / task.products[0]).parent
    train(options, training, out / task.setting["dataset"], task.spec["fabrics"], folder, progress)


def _bench(task: Task, out: Path, progress: Progress) -> None:
    from jobs.run import measuring

    {
        "truth": measuring.truth,
        "method": measuring.method,
        "extremes": measuring.extremes,
        "latents": measuring.latents,
        "timing": measuring.timing,
        "frames": measuring.frames,
        "edge": measuring.edge,
        "shot": measuring.shot,
        "scene": measuring.scene,
        "frame time": measuring.frame_time,
    }.get(task.setting["make"], measuring.picture)(task, out, progress)


def _report(task: Task, out: Path, progress: Progress) -> None:
    from jobs.run.measuring import page

    page(task, out, progress)


def model_options(table: Mapping[str, Any]) -> Any:
    """Return the option class that a model's table describes."""
    from pydantic import TypeAdapter

    from pipeline.models.catalogue import ModelOptions

    return TypeAdapter(ModelOptions).validate_python(table)


RUNNERS: Final[dict[Stage, Callable[[Task, Path, Progress], None]]] = {
    "generate": _generate,
    "train": _train,
    "bench": _bench,
    "report": _report,
}
