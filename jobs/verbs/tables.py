"""What the command line shows: fabrics, plans, states and summaries as tables."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from jobs.plan.task import STAGES, Stage, Task, urgencies
from jobs.recipe.recipe import Recipe
from jobs.run.ledger import Ledger
from weaves.fabric import Fabric
from weaves.yarn import Yarn

_UNITS = {"width": "yarn spacings", "bend": "degrees", "twist": "degrees"}


def fabrics_table(fabrics: Sequence[Fabric]) -> Table:
    """List fabrics: name, draft, repeat, source."""
    table = _table("fabric", "draft", "repeat", "source")
    for fabric in fabrics:
        ends, picks = fabric.weave.repeat
        table.add_row(fabric.name, fabric.weave.name, f"{ends} × {picks}", fabric.source)
    return table


def recipes_table(recipes: Sequence[Recipe]) -> Table:
    """List recipes: name and what they are for."""
    table = _table("recipe", "for")
    for recipe in recipes:
        table.add_row(recipe.name, recipe.about)
    return table


def fabric_page(fabric: Fabric) -> RenderableType:
    """Show a fabric: the drawdown and the numbers of its yarns."""
    ends, picks = fabric.weave.repeat
    table = _table("yarn", "warp", "weft", "unit")
    for name in Yarn.model_fields:
        warp, weft = (_value(getattr(yarn, name)) for yarn in (fabric.warp, fabric.weft))
        table.add_row(name, warp, weft, _UNITS.get(name, ""))
    heading = f"{fabric.name}: {fabric.weave.name}, {ends} ends × {picks} picks (██ warp over, last pick first)"
    return Group(
        Text(heading),
        Text(""),
        Text(fabric.weave.text()),
        Text(""),
        table,
        Text(f"optical thickness {fabric.optical_thickness:g}"),
        Text(fabric.source),
    )


def plan_table(tasks: Sequence[Task]) -> Table:
    """Show a plan: tasks, rows, bytes and time on one core, by stage and kind, with totals."""
    table = _table("stage", "what", "tasks", "rows", "size", "one core", right=("tasks", "rows", "size", "one core"))
    for stage in STAGES:
        groups: dict[str, list[Task]] = {}
        for task in tasks:
            if task.stage == stage:
                groups.setdefault(task.group, []).append(task)
        for group, members in groups.items():
            table.add_row(stage, group, *_sums(members))
        table.add_section()
    table.add_row("all", "", *_sums(tasks))
    cores = os.cpu_count() or 1
    seconds = max(sum(task.cost for task in tasks) / cores, *urgencies(tasks).values(), 0.0)
    table.caption = f"about {duration(seconds)} on the {cores} cores of this machine"
    return table


def status_table(tasks: Sequence[Task], ledger: Ledger) -> Table:
    """Show what the files say: done, failed and missing tasks by stage, and the reason of each failure."""
    table = _table("stage", "done", "failed", "missing", right=("done", "failed", "missing"))
    states = {task.id: ledger.state(task) for task in tasks}
    for stage in STAGES:
        found = [states[task.id] for task in tasks if task.stage == stage]
        if found:
            table.add_row(stage, *(str(found.count(state)) for state in ("done", "failed", "missing")))
    failed = [f"{task.title}: {ledger.reason(task)}" for task in tasks if states[task.id] == "failed"]
    table.caption = "\n".join(failed) or None
    return table


def summary_table(tasks: Sequence[Task], ran: Mapping[str, float]) -> Table:
    """Show what a run did: tasks by stage, how many of them it did now, and the seconds of work in them."""
    table = _table("stage", "tasks", "done now", "work", right=("tasks", "done now", "work"))
    stages: list[Stage] = [stage for stage in STAGES if any(task.stage == stage for task in tasks)]
    for stage in stages:
        ids = [task.id for task in tasks if task.stage == stage]
        now = [ran[key] for key in ids if key in ran]
        table.add_row(stage, str(len(ids)), str(len(now)), duration(sum(now)) if now else "")
    return table


def methods_table(frame: Any) -> Table:
    """Show a benchmark condensed to one row a method (a DataFrame from `reports.tables.summary.summary_table`).

    Bytes are left to the page, so that a line fits a terminal of 80 columns.
    """
    frame = frame.drop(columns="bytes", errors="ignore").rename(columns={"ns/query": "ns a query"})
    names = list(frame.columns)
    table = _table("method", *names, right=names)
    table.columns[0].no_wrap = True
    table.padding = (0, 1, 0, 0)
    for (method, setting), *values in frame.itertuples():
        table.add_row(f"{method} {setting}".strip(), *(_number(value) for value in values))
    return table


def evaluation_table(summary: Any) -> Table:
    """Show what `twillight evaluate` did (a Summary from `pipeline.shards.evaluate`)."""
    answered = summary.rows - summary.bad
    table = _table("rows", "answered", "median relative error", "points a query", "queries a second")
    for column in table.columns:
        column.justify = "right"
    table.add_row(
        f"{summary.rows:,}",
        f"{answered:,}",
        "–"
        if summary.median_relative_error != summary.median_relative_error
        else f"{summary.median_relative_error:.2%}",
        _number(summary.points / answered) if answered and summary.points else "–",
        _number(answered / summary.seconds) if summary.seconds else "–",
    )
    return table


def invariants_table(name: str, found: Sequence[Any]) -> Table:
    """Show the invariants of a fabric (a sequence of `pipeline.truth.checks.check_result.CheckResult`)."""
    table = _table("invariant", "value", "should be", "holds", "", right=("value",))
    for item in found:
        style = "bold red" if item.status == "broken" else ""
        table.add_row(item.name, _measured(item), _should_be(item), _holds(item), item.note, style=style)
    table.title, table.title_justify = name, "left"
    return table


def _measured(item: Any) -> str:
    value = f"{item.measured:.4g}"
    return f"{value} ± {item.standard_error:.1g}" if item.standard_error else value


def _should_be(item: Any) -> str:
    return "–" if item.relation == "reported" else f"{item.relation} {item.expected:g}"


def _holds(item: Any) -> str:
    inside = item.relation == "<=" and item.sigmas < -5
    match item.status:
        case "exact":
            return "exactly"
        case "statistics":
            return f"by {-item.sigmas:.0f} σ" if inside else f"within statistics ({item.sigmas:+.1f} σ)"
        case "broken":
            return f"NO ({item.sigmas:+.1f} σ)" if item.standard_error else "NO"
    return "a number only"


def duration(seconds: float) -> str:
    """Write a time as a person would say it."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 2 * 3600:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.1f} h" if seconds < 48 * 3600 else f"{seconds / 86400:.1f} days"


def _sums(tasks: Sequence[Task]) -> tuple[str, str, str, str]:
    rows, size = sum(task.rows for task in tasks), sum(task.size for task in tasks)
    return (
        f"{len(tasks):,}",
        f"{rows:,}" if rows else "",
        _size(size) if size else "",
        duration(sum(task.cost for task in tasks)),
    )


def _size(count: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def _number(value: float) -> str:
    """Write a measured number with three digits; a missing one as a dash."""
    if value != value:
        return "–"
    if 0 < abs(value) < 0.01:
        return f"{value:.1e}"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _value(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _table(*columns: str, right: Sequence[str] = ()) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold", caption_justify="left")
    for column in columns:
        table.add_column(column, justify="right" if column in right else "left")
    return table
