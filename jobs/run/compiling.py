"""The kernels that tasks use, compiled before the tasks start.

A group is one estimator, or one model that learns nothing, evaluated on a few queries. Workers compile several groups
at the same time; kernels that groups share are compiled once (`pipeline.compiled.decorators`). A kernel that no group
reaches is compiled by the first task that calls it.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Final, NamedTuple

from jobs.plan.task import Task
from pipeline.models.options import Options
from pipeline.truth.options import TruthOptions

_ROWS: Final = 8
_LONGEST_FIRST: Final = ("node_table", "quadrature", "soft_nodes", "owen")


class KernelGroup(NamedTuple):
    """Kernels that are compiled together: those of an estimator, or of a model."""

    name: str
    model: Options | None = None  # None: `name` is an estimator

    def compile(self, ready: Callable[[str], None]) -> None:
        """Compile the kernels, or read them from the cache; `ready` is called with the name of each kernel."""
        from pipeline.compiled.decorators import announced
        from pipeline.models.registry import load_methods
        from pipeline.shards.queries import QueryOptions, draw_queries
        from pipeline.truth.estimator import estimate
        from weaves.fabric import load_fabric, preset_names

        fabric = load_fabric(preset_names()[0])
        # Rotated footprints call kernels that round ones do not; tables know no narrow ones, seen from the side.
        kinds = [QueryOptions(), QueryOptions(stretch=4.0)] if self.name == "auto" else [QueryOptions()]
        kinds = [QueryOptions(sigma=(4.0, 8.0), max_angle=60.0)] if self.name == "node_table" else kinds
        with announced(ready):
            for kind in kinds:
                queries = draw_queries(kind, fabric.weave.repeat, 0, 0, _ROWS)
                if self.model is None:
                    options = {"estimator": self.name, "min_count": 32, "max_count": 32}
                    options |= {"walls": "left_out"} if self.name == "quadrature" else {}
                    estimate(fabric, queries, TruthOptions.model_validate(options), 0)
                else:
                    for method in load_methods(self.model):
                        method.predict(fabric, queries)


def kernel_groups(tasks: Iterable[Task]) -> list[KernelGroup]:
    """Return the groups that some tasks use, those that take longest first."""
    groups: dict[str, KernelGroup] = {}
    for task in tasks:
        for name in _estimators(task):
            groups[name] = KernelGroup(name)
        for options in task.held(Options):
            if not options.learns and options.model != "added":  # code from outside runs in a process of its own
                # The value of the parameter is an argument of the same kernels; the first level may not need all.
                last = options.single()[-1]
                key = last.model_dump_json(exclude={"name", last.parameter})
                groups.setdefault(key, KernelGroup(last.name, last))
    order = {name: place for place, name in enumerate(_LONGEST_FIRST)}
    return sorted(groups.values(), key=lambda group: order.get(group.name, len(order)))


def _estimators(task: Task) -> Iterator[str]:
    """Yield the estimators that a task evaluates, `owen` for those with its kernels; a page evaluates none."""
    for truth in task.held(TruthOptions) if task.stage != "report" else ():
        yield "owen" if truth.estimator in ("mc", "r2") else truth.estimator
    if "fallback" in task.versions():
        yield from ("node_table", "owen")  # which answer queries outside the domain of a method
