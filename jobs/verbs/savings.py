"""`twillight savings`: measured savings of a scene's own recipe against the general one, both finished.

Rows and seconds come from the ledger, queries learnt from are steps taken times batch, errors and the time of a frame
are the Records of both pages. The general recipe is charged for the scene's method alone: the rows that it learns from
and is measured on, and its first training; its errors are means over all its trainings. The time of a frame is also
given in frames of point sampling at 2 points, timed in turns with it. The last rows are the fallback shares of both
models in the other scenes of the general recipe: a scene's own model answers for its own domain only.
"""

import csv
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Final, NamedTuple

from cyclopts import Parameter

from jobs.plan.measurements.scenes import OnScene, SceneShot
from jobs.plan.plan import plan
from jobs.plan.task import Task
from jobs.plan.training import Training
from jobs.recipe.fallback_share import fallback_share
from jobs.recipe.load import load_recipe
from jobs.recipe.recipe import ModelRecipe, Recipe
from jobs.run.ledger import Ledger
from jobs.terminal import print_lines, print_table
from jobs.verbs.parameters import NOTHING, OUT, Add, Out, RecipeName
from jobs.verbs.require_recipe import alone
from pipeline.atomic import atomic_write
from pipeline.models.card import read_card
from pipeline.scenes.catalogue import load_scene
from weaves.errors import BadInput

_ENOUGH: Final = 3.0  # least factor by which a scene's recipe should reduce rows and training
_MEASURED: Final = ("mse", "colour_rrmse", "flicker", "fallback_share", "frame_time")  # that are held side by side

DIFFERENCE: Final = "mse, own less general"
"""Quantity that pairs both pictures, pixel by pixel (`reports.measure.block_bootstrap`)."""


class Value(NamedTuple):
    """A number and, where it has one, its 95 % interval (of times the quartiles)."""

    value: float
    low: float | None = None
    high: float | None = None


class SceneSaving(NamedTuple):
    """One quantity of a scene by both recipes."""

    scene: str
    method: str
    quantity: str
    unit: str
    general: Value
    narrow: Value

    @property
    def ratio(self) -> float:
        """Quotient of the general recipe's value a and the own one's b; nan if a is 0, infinite if only b is."""
        a, b = self.general.value, self.narrow.value
        return math.nan if not a else a / b if b else math.inf


def savings(
    recipe: RecipeName,
    scenes: Annotated[list[str], Parameter(help="Scenes whose own recipes, written by `require`, are finished.")],
    *,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """Print the savings of scenes' own recipes, and write them to ``report/savings.csv``.

    BadInput if a recipe is not there, has not run, or did not measure the scene.
    """
    general = load_recipe(recipe, add)
    names = dict.fromkeys(load_scene(scene).name for scene in scenes)
    by_scene = [saved(name, out, general, recipe, add) for name in names]
    for rows in by_scene:
        _print(rows)
    print_lines(*map(conclusion, by_scene))
    path = out / "report" / "savings.csv"
    atomic_write(path, _csv([row for rows in by_scene for row in rows]).encode())
    print_lines(f"the numbers: {path}")


def saved(scene: str, out: Path, general: Recipe, run: str = "", add: Sequence[str] = ()) -> list[SceneSaving]:
    """Return the costs of a scene by the general recipe, which is run by the name `run`, and by its own recipe."""
    path = out / "recipes" / f"require-{scene}.toml"
    if not path.is_file():
        raise BadInput("savings", "scene", scene, f"there is no {path}; write it with `twillight require {scene}`")
    own = load_recipe(path, add)
    model = own.models[0]
    name, worn = model.options.name, {fabric.name for fabric in own.seen}
    same = next((candidate for candidate in general.models if candidate.options.name == name), None)
    if same is None:
        raise BadInput(str(path), "models.0.name", name, f"{general.name} has no such method; require the scene again")
    both, ledger = [], Ledger(out)
    for whole, chosen, called in ((general, same, run or general.name), (own, model, str(path))):
        costs = _costs(alone(whole, {name}), chosen, worn, ledger, plan(whole), called)
        both.append(costs | _measured(out, whole.name, scene, model, called))
    if ledger.state(plan(own)[-1]) != "done":
        raise BadInput("savings", "recipe", own.name, f"its page is older than the recipe; `twillight run {path}`")
    theirs, ours = both
    rows = [SceneSaving(scene, name, *what, value, ours[what]) for what, value in theirs.items()]
    rows += _difference(scene, out, (general, own), model)
    return [*rows, *_elsewhere(scene, out, ((same, general), (model, own)))]


def conclusion(rows: Sequence[SceneSaving]) -> str:
    """Return a sentence on the savings of a scene's recipe and its error."""
    by = {row.quantity: row for row in rows}
    generated, learnt, error = by["queries generated"], by["queries learnt from"], by["mse"]
    fewer = [f"{generated.ratio:.1f} times fewer queries to generate"]
    if not math.isnan(learnt.ratio):
        fewer.append(f"{learnt.ratio:.1f} times fewer to learn from")
    ratio = f"MSE {error.narrow.value:.2g} in place of {error.general.value:.2g}"
    if DIFFERENCE in by:
        low, high = by[DIFFERENCE].narrow[1:]
        proven = "less" if (high or 0.0) < 0.0 else "more" if (low or 0.0) > 0.0 else "no difference shown"
        ratio += f", paired: {proven}"
    most = max(saving.ratio for saving in (generated, learnt) if not math.isnan(saving.ratio))
    short = "" if most >= _ENOUGH else f"; less than {_ENOUGH:g} times"
    return f"{rows[0].scene}, {rows[0].method}: {', '.join(fewer)}; {ratio}{short}."


def _costs(
    recipe: Recipe, model: ModelRecipe, worn: set[str], ledger: Ledger, whole: Sequence[Task], run: str
) -> dict[tuple[str, str], Value]:
    """Return the costs of data and training of one method, from the receipts, and the weights that a scene needs."""
    # The same tasks, by the folders that the whole recipe puts them in.
    planned = {task.id for task in plan(recipe)}
    tasks = [task for task in whole if task.id in planned and task.stage in ("generate", "train")]
    if left := [task for task in tasks if ledger.state(task) != "done"]:
        allowed = f"{len(left)} of {len(tasks)} tasks behind {model.options.name} are not done; `twillight run {run}`"
        raise BadInput("savings", "recipe", recipe.name, allowed)
    shards = [task for task in tasks if task.stage == "generate"]
    trainings = [task for task in tasks if isinstance(task, Training)]
    cards = [read_card(ledger.out / task.folder) for task in trainings]
    needed = [task for task in trainings if not model.options.of_one_material or worn.issuperset(task.fabrics)]
    return {
        ("queries generated", "1"): Value(sum(task.rows for task in shards)),
        ("generation", "s"): Value(sum(ledger.seconds(task) for task in shards)),
        ("queries learnt from", "1"): Value(sum(card["steps_taken"] * model.training.batch for card in cards)),
        ("training", "s"): Value(sum(ledger.seconds(task) for task in trainings)),
        ("weights", "bytes"): Value(sum(ledger.store.size(task.products[0]) or 0 for task in needed)),
    }


def _measured(out: Path, page: str, scene: str, model: ModelRecipe, run: str) -> dict[tuple[str, str], Value]:
    """Return a method's numbers on a scene from a page, and the time of its frame over that of 2 points."""
    from reports.over_seeds import over_trainings
    from reports.record import OF_A_PAGE, read_records
    from reports.tables.summary import BASELINE

    method, setting = model.options.name, _setting(model)
    path = out / "report" / page / OF_A_PAGE
    if not path.is_file():
        raise BadInput("savings", "recipe", page, f"it has no page in {out / 'report'}; `twillight run {run}` first")
    records = over_trainings(read_records([path]))
    here = [record for record in records if record.scene == scene and not record.fabric]
    by_metric = {record.metric: record for record in here if (record.method, record.setting) == (method, setting)}
    if lacking := [metric for metric in _MEASURED if metric not in by_metric]:
        allowed = f"the page of {page} has no {lacking[0]} of {method} there; `twillight run {run}`"
        raise BadInput("savings", "scene", scene, allowed)
    measured = [by_metric[metric] for metric in _MEASURED]
    values = {(record.metric, record.unit): Value(record.value, record.low, record.high) for record in measured}
    base = [r.value for r in here if (r.method, r.setting) == BASELINE and r.metric == "frame_time"]
    relative = by_metric["frame_time"].value / base[0] if base else math.nan
    return values | {("frame_time over 2 points", "1"): Value(relative)}


def _difference(scene: str, out: Path, recipes: tuple[Recipe, Recipe], model: ModelRecipe) -> list[SceneSaving]:
    """Return the difference of the errors of both models; nothing if a picture or the truth's frames are not sound."""
    from reports.images.exr import RGB, read_exr
    from reports.measure.block_bootstrap import mse_difference
    from reports.measure.scene.shot import read_shot

    name, setting, ledger = model.options.name, _setting(model), Ledger(out)
    tasks = [task for recipe in recipes for task in plan(recipe) if isinstance(task, SceneShot | OnScene)]
    tasks = [task for task in tasks if task.scene == scene and not task.larger]
    shots = [task for task in tasks if isinstance(task, SceneShot) and ledger.done(task, verify=True)]
    shown = [task for task in tasks if isinstance(task, OnScene) and task.model.options.name == name]
    shown = [task for task in shown if setting in task.shown and ledger.done(task, verify=True)]
    if len(shown) != 2 or not shots:
        return []
    shot = read_shot(out / shots[-1].made.path)
    a, b = (read_exr(out / task.picture(setting)).stack(*RGB) for task in shown)
    difference = mse_difference(a, b, shot.pictures()[0], shot.lit[0], recipes[0].bench.scenes.image)
    return [SceneSaving(scene, name, DIFFERENCE, "1", Value(0.0), Value(*difference))]


def _setting(model: ModelRecipe) -> str:
    """Return the first of a model's settings, of which a scene's recipe has one."""
    return next(map(model.options.setting_of, model.options.settings), "")


def _elsewhere(scene: str, out: Path, models: Sequence[tuple[ModelRecipe, Recipe]]) -> Iterator[SceneSaving]:
    """Yield the fallback shares of both models in the general recipe's other scenes whose frames exist."""
    from reports.measure.scene.shot import read_shot

    (same, general), _ = models
    for task in plan(general):
        if not isinstance(task, SceneShot) or task.larger or not Ledger(out).done(task, verify=True):
            continue
        shot = read_shot(out / task.made.path)
        if shot.name != scene:
            queries = [(cloth.fabric, cloth.queries) for cloth in shot.cloths]
            shares = (Value(fallback_share(*of, queries)) for of in models)
            yield SceneSaving(scene, same.options.name, f"fallback_share in {shot.name}", "1", *shares)


def _print(rows: Sequence[SceneSaving]) -> None:
    cells = []
    for row in rows:
        unit = "" if row.unit == "1" else f", {row.unit}"
        ratio = "–" if math.isnan(row.ratio) else f"{row.ratio:.3g}"
        cells.append((f"{row.quantity}{unit}", _shown(row.general), _shown(row.narrow), ratio))
    columns = (f"{rows[0].scene}, {rows[0].method}", "general", "own", "times less")
    print_table(columns, cells)
    print_lines("")


def _shown(value: Value) -> str:
    number = f"{value.value:,.0f}" if abs(value.value) >= 1e4 else f"{value.value:.3g}"
    return number if value.low is None else f"{number} ({value.low:.2g} to {value.high:.2g})"


def _csv(rows: Sequence[SceneSaving]) -> str:
    text = io.StringIO()
    writer = csv.writer(text)
    values = [f"{name}{end}" for name in ("general", "own") for end in ("", "_low", "_high")]
    writer.writerow(("scene", "method", "quantity", "unit", *values, "ratio"))
    writer.writerows((*row[:4], *row.general, *row.narrow, row.ratio) for row in rows)
    return text.getvalue()
