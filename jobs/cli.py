"""Command line of twillight: the verbs in the order of work.

Errors and exit codes are in `jobs.exits`. A verb's modules are imported when it runs, so that help is fast.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter, Token

from jobs.exits import print_error, run_to_exit
from weaves.errors import BadInput, one_line

if TYPE_CHECKING:
    from jobs.run.cluster import Scheduler

app = App(
    name="twillight",
    help="Woven cloth at every scale, from a weave draft to the light it returns: "
    "ground truth, neural models, and a benchmark of their errors and times.",
    version_flags=(),
    suppress_keyboard_interrupt=False,
    group_commands="Verbs, in the order of work",
    default_parameter=Parameter(negative=()),
)

FabricName = Annotated[str, Parameter(help="Name of a preset, or path of a .toml file.")]
RecipeName = Annotated[str, Parameter(help="Name of a recipe of the package, or path of a .toml file.")]
Add = Annotated[
    list[str],
    Parameter(help="Method or metric from outside: MODULE:NAME, FILE.py:NAME, or an installed method; runs its code."),
]
NOTHING: list[str] = []


def _place(type_: object, tokens: Sequence[Token]) -> Path:
    """Return the path of a folder or file of this machine or of object storage."""
    from pipeline.storage import place

    return place(tokens[0].value, tokens[0].keyword or "")


def _local(type_: object, tokens: Sequence[Token]) -> Path:
    """Return the path of a folder or file of this machine; refuse an address of object storage."""
    name = tokens[0].value
    if "://" in name:
        found = _place(type_, tokens)
        if not isinstance(found, Path):
            raise ValueError(f"{one_line(name, 80)} is an address; a path of this machine is needed here")
        return found
    return Path(name)


Local = Annotated[Path, Parameter(converter=_local)]
"""A path of this machine."""
Place = Annotated[Any, Parameter(converter=_place)]
"""A path; `Any`, because one of object storage is no `pathlib.Path` to pydantic, which cyclopts may call."""
Out = Annotated[Place, Parameter(help="Folder of all products, or an address such as s3://bucket/x.")]

OUT = Path("out")


@dataclass(frozen=True)
class WorkerFlags:
    """Processes that do the tasks, and how their progress is shown."""

    workers: Annotated[int, Parameter(help="Worker processes on this machine, one thread each; 0: one per core.")] = 0
    scheduler: Annotated[
        str, Parameter(help="Address or scheduler file of a running dask scheduler; default: this machine.")
    ] = ""
    tls_ca: Annotated[str, Parameter(help="Certificate of the scheduler's authority, a PEM file.")] = ""
    tls_certificate: Annotated[str, Parameter(help="Own certificate for the scheduler, a PEM file.")] = ""
    tls_key: Annotated[str, Parameter(help="Its key, a PEM file.")] = ""
    progress: Annotated[
        Literal["auto", "rich", "plain", "json"],
        Parameter(help="Progress as bars, as lines of a log, or as JSON lines; auto: bars on a terminal, else lines."),
    ] = "auto"

    def connection(self) -> Scheduler:
        """Return the scheduler to connect to."""
        from jobs.run.cluster import Scheduler

        return Scheduler(self.scheduler, self.tls_ca, self.tls_certificate, self.tls_key)


@dataclass(frozen=True)
class TruthFlags:
    """Options of the truth on the command line; None: the default of `pipeline.truth.options.TruthOptions`."""

    estimator: Annotated[str | None, Parameter(help="Estimator of the truth: auto, quadrature, owen, mc, …")] = None
    relative_error: Annotated[float | None, Parameter(help="Relative error at which an estimate stops.")] = None
    absolute_error: Annotated[float | None, Parameter(help="Absolute error at which it stops, in 1/sr.")] = None
    max_count: Annotated[int | None, Parameter(help="Most points of a row, a power of 2.")] = None
    footprint: Annotated[str | None, Parameter(help="gaussian or box.")] = None
    frame: Annotated[str | None, Parameter(help="Normal of the cosines inside the yarns: ply or macro.")] = None
    normaliser: Annotated[str | None, Parameter(help="Area in the denominator: visible or projected.")] = None


@dataclass(frozen=True)
class YarnFlags:
    """Numbers of a yarn on the command line; None: those of the draft file, or of the fabric named by --like."""

    width: Annotated[float | None, Parameter(help="Width in yarn spacings, in place of the file's.")] = None
    bend: Annotated[float | None, Parameter(help="Largest inclination along a float, degrees.")] = None
    twist: Annotated[float | None, Parameter(help="Angle of the fibres to the yarn's axis, degrees.")] = None
    roughness: Annotated[float | None, Parameter(help="Roughness of the fibres.")] = None

    def given(self) -> dict[str, float]:
        """Return the numbers that are given."""
        return {key: value for key, value in asdict(self).items() if value is not None}


On = Annotated[WorkerFlags, Parameter(name="*")]


@app.command(name="list", sort_key=0)
def list_() -> None:
    """List the fabrics and the recipes of the package."""
    from jobs.verbs.list import print_lists

    print_lists()


@app.command(name="import", sort_key=0.5)
def import_(
    draft: Annotated[Local, Parameter(help="Draft file: .wif, .wifw, .dtx, .wpo or .twa.")],
    *,
    out: Annotated[Local, Parameter(help="Fabric file to write, ending in .toml.")],
    like: Annotated[str, Parameter(help="Fabric whose yarns give what a draft does not state.")] = "cotton_twill",
    name: Annotated[str | None, Parameter(help="Name of the fabric; default: that of the draft file.")] = None,
    warp: Annotated[YarnFlags, Parameter(name="--warp")] = YarnFlags(),
    weft: Annotated[YarnFlags, Parameter(name="--weft")] = YarnFlags(),
) -> None:
    """Make a fabric from the draft file of a weaving program."""
    from jobs.verbs.exchange import import_draft

    import_draft(draft, out, like, name, {"warp": warp.given(), "weft": weft.given()})


@app.command(sort_key=1)
def show(
    fabric: FabricName,
    *,
    out: Annotated[
        Local | None, Parameter(help="Folder for pictures, a lit swatch among them, as PNG and EXR.")
    ] = None,
) -> None:
    """Show a fabric: its drawdown and its yarns."""
    from jobs.verbs.show import show as print_fabric

    print_fabric(fabric, out)


@app.command(sort_key=2)
def export(
    fabric: FabricName,
    *,
    mesh: Annotated[Local | None, Parameter(help="Triangle mesh to write, ending in .ply.")] = None,
    wif: Annotated[Local | None, Parameter(help="Draft file for weaving programs to write, ending in .wif.")] = None,
    maps: Annotated[Local | None, Parameter(help="Folder of texture maps and materials to write.")] = None,
    shader: Annotated[Local | None, Parameter(help="Folder of a shader with its tables to write.")] = None,
    vertices: Annotated[int | None, Parameter(help="Of a mesh: steps across a yarn and along a cell; 64.")] = None,
    repeats: Annotated[int | None, Parameter(help="Of a mesh: copies of the repeat in each direction; 1.")] = None,
    size: Annotated[int | None, Parameter(help="Of maps: texels of the longer side, a power of two; 2048.")] = None,
    model: Annotated[
        str | None, Parameter(help="Of a shader: soft_nodes (default), selvage, or the folder of a trained neumip.")
    ] = None,
    level: Annotated[int | None, Parameter(help="Of a shader: level of detail, 1, 2, 4 or 8; 2.")] = None,
    language: Annotated[
        list[str],
        Parameter(help="Of a shader: cpp, cuda, glsl, glsles, hlsl, metal, wgsl, onnx or all, beside Slang; several."),
    ] = NOTHING,
    kind: Annotated[
        list[str],
        Parameter(help="Of a shader: behind, curvature or all, beside lights and viewers in front of flat cloth."),
    ] = NOTHING,
) -> None:
    """Write a fabric for other programs: a mesh, a draft, texture maps and materials, or a shader."""
    from jobs.verbs.exchange import export_fabric

    paths = {"mesh": mesh, "wif": wif, "maps": maps, "shader": shader}
    options = {"vertices": vertices, "repeats": repeats, "size": size, "model": model, "level": level}
    export_fabric(fabric, paths, {**options, "language": language, "kind": kind})


@app.command(sort_key=2)
def view(
    fabric: FabricName,
    *,
    out: Annotated[Local, Parameter(help="Page to write, ending in .html.")],
    truth: Annotated[
        int, Parameter(help="Pixels along each side of the pictures by the truth and other methods; 0: none.")
    ] = 160,
) -> None:
    """Write a page of one file that draws a fabric while light and viewer turn, and compares methods."""
    from jobs.verbs.exchange import view as write_page

    write_page(fabric, out, truth)


@app.command(sort_key=2)
def render(
    scene: Annotated[str, Parameter(help="Name of a scene of the package, or path of an .xml or .toml file.")],
    *,
    out: Annotated[Local, Parameter(help="File ending in .png, .exr or .mp4, or a folder for numbered pictures.")],
    fabric: Annotated[list[str], Parameter(help="Fabric in place of the next cloth's own; several.")] = [],  # noqa: B006
    method: Annotated[str, Parameter(help="truth, selvage, soft_nodes, point_sampled:16, … or a folder.")] = "selvage",
    size: Annotated[str, Parameter(help="WIDTHxHEIGHT in pixels; default: the film of the scene.")] = "",
    frames: Annotated[int | None, Parameter(help="Frames of a film or folder; default: the scene's.")] = None,
    samples: Annotated[int, Parameter(help="Rays a pixel: 1, 4, 9, … 64; more smooth silhouettes.")] = 1,
    directions: Annotated[int, Parameter(help="Directions that an environment light is replaced by.")] = 8,
    tone: Annotated[Literal["srgb", "reinhard"], Parameter(help="Tone curve; srgb cuts at 1.")] = "srgb",
    exposure: Annotated[float, Parameter(help="Exposure in stops; 0: that of the page.")] = 0.0,
) -> None:
    """Render a scene with any fabrics by any method."""
    from jobs.verbs.render.look import look
    from jobs.verbs.render.render import render as rendered

    rendered(scene, fabric, method, frames, look(size, samples, directions, tone, exposure), out)


@app.command(sort_key=3)
def plan(
    recipe: RecipeName,
    *,
    add: Add = NOTHING,
    out: Out = OUT,
    workers: Annotated[int, Parameter(help="Show how long so many workers take, and where it stops scaling.")] = 0,
) -> None:
    """Show what would run and why, with rows, bytes and time; nothing is computed."""
    from jobs.verbs.plan import print_plan

    print_plan(recipe, out, workers, add)


@app.command(sort_key=4)
def generate(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT, on: On = WorkerFlags()) -> None:
    """Compute the ground truth: the shards of a recipe's data set."""
    from jobs.verbs.run import work

    work(recipe, ["generate"], out, on.connection(), on.workers, on.progress, add)


@app.command(sort_key=5)
def evaluate(
    fabric: FabricName,
    queries: Annotated[Place, Parameter(help="Parquet file of queries, with the columns of a shard.")],
    *,
    out: Annotated[Place, Parameter(help="Parquet file to write.")],
    model: Annotated[str | None, Parameter(help="Trained model, by name or folder, in place of the truth.")] = None,
    extrapolate: Annotated[bool, Parameter(help="Evaluate it also for yarns outside its training domain.")] = False,
    truth: Annotated[TruthFlags, Parameter(name="*")] = TruthFlags(),
    seed: Annotated[int, Parameter(help="Seed of the random numbers.")] = 0,
    workers: Annotated[int, Parameter(help="Threads; 0: one per core.")] = 0,
    skip_bad: Annotated[bool, Parameter(help="List rows that cannot be evaluated, and continue.")] = False,
) -> None:
    """Evaluate a file of queries on a fabric: its rows with the BSDF values."""
    from jobs.verbs.evaluate import evaluate as answer
    from jobs.verbs.evaluate import truth_options
    from weaves.fabric import load_fabric

    chosen = asdict(truth)
    options, cloth, other = truth_options(**chosen), load_fabric(fabric), None
    if model is not None:
        from jobs.verbs.evaluate_model import answerer, refuse_truth_options

        refuse_truth_options(chosen | {"seed": seed or None})
        other = answerer(model, cloth, extrapolate)
    answer(cloth, queries, out, options, seed, workers, skip_bad, other)


@app.command(sort_key=6)
def check(
    subject: Annotated[str, Parameter(help="Recipe, folder of a data set, or fabric.")],
    *,
    repair: Annotated[bool, Parameter(help="Make the damaged and missing files of a recipe again.")] = False,
    add: Add = NOTHING,
    out: Out = OUT,
    on: On = WorkerFlags(),
) -> int:
    """Check all files of a recipe, the shards of a data set, or the ground truth of a fabric."""
    from jobs.recipe.recipe import Recipe
    from jobs.verbs.check import check_dataset, check_fabric, resolve
    from weaves.fabric import Fabric

    found = resolve(subject, add)
    if isinstance(found, Recipe):
        from jobs.verbs.check_recipe import check_recipe
        from jobs.verbs.check_recipe import repair as repaired

        if repair:
            return repaired(subject, out, on.connection(), on.workers, on.progress, add)
        return check_recipe(subject, out, add)
    if repair:
        raise BadInput("check", "--repair", subject, "only the files of a recipe can be made again; name a recipe")
    if isinstance(found, Fabric):
        check_fabric(found)
        return 0
    faults = check_dataset(found)
    for fault in faults:
        print_error(fault)
    return BadInput.exit_code if faults else 0


@app.command(sort_key=7)
def train(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT, on: On = WorkerFlags()) -> None:
    """Train the models of a recipe on its data set."""
    from jobs.verbs.run import work

    work(recipe, ["train"], out, on.connection(), on.workers, on.progress, add)


@app.command(sort_key=8)
def bench(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT, on: On = WorkerFlags()) -> None:
    """Measure error, aliasing and time of every method; the recipes `truth` and `mitsuba`: the truth, Mitsuba."""
    from jobs.verbs.run import work

    work(recipe, ["bench"], out, on.connection(), on.workers, on.progress, add)


@app.command(sort_key=9)
def report(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT, on: On = WorkerFlags()) -> None:
    """Write the page: pictures, tables and plots of all measurements."""
    from jobs.verbs.run import work

    work(recipe, ["report"], out, on.connection(), on.workers, on.progress, add)


@app.command(sort_key=10)
def run(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT, on: On = WorkerFlags()) -> None:
    """Generate, train, bench and report; finished tasks are skipped."""
    from jobs.plan.task import STAGES
    from jobs.verbs.run import work

    work(recipe, STAGES, out, on.connection(), on.workers, on.progress, add)


@app.command(sort_key=11)
def status(recipe: RecipeName, *, add: Add = NOTHING, out: Out = OUT) -> None:
    """Show which tasks are done, failed (with the reason) or missing."""
    from jobs.verbs.status import print_status

    print_status(recipe, out, add)


@app.command(sort_key=12)
def prune(
    recipes: Annotated[list[str], Parameter(help="Recipes whose products are kept, by name or path.")],
    *,
    delete: Annotated[bool, Parameter(help="Remove what is listed.")] = False,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """List, or remove, the products that none of some recipes needs."""
    from jobs.verbs.prune import prune as pruned

    pruned(recipes, out, delete, add)


@app.command(sort_key=13)
def merge(
    a: Annotated[Local, Parameter(help="Folder of products.")],
    b: Annotated[Local, Parameter(help="Another one, for example of another machine.")],
    *,
    out: Annotated[Local, Parameter(help="Folder of all products; created if need be.")],
) -> int:
    """Join two folders of products, such as parts of a data set made on two machines."""
    from jobs.verbs.merge import merge as merged

    return merged([a, b], out)


records = App(name="records", help="Join Records of several machines.", sort_key=14)
app.command(records)


@records.command(name="merge")
def merge_records(
    files: Annotated[list[Local], Parameter(help="Files of Records, folders of pages, or folders of products.")],
    *,
    recipe: Annotated[str, Parameter(help="Recipe, if a folder of products has several pages.")] = "",
    out: Annotated[Local, Parameter(help="File of Records to write, ending in .json.")],
) -> None:
    """Join Records of several machines in one file; times of each stay apart."""
    from jobs.verbs.merge import merge_records as merged

    merged(files, recipe, out)


@app.command(sort_key=14)
def publish(
    dataset: Annotated[Path, Parameter(help="Folder of a data set, out/datasets/NAME-FINGERPRINT.")],
    *,
    to: Annotated[Path | None, Parameter(help="Folder to write; empty or not there.")] = None,
    licence: Annotated[str | None, Parameter(help="SPDX identifier of the data's licence, such as CC-BY-4.0.")] = None,
    author: Annotated[list[str], Parameter(help="Author for the citation; may be given several times.")] = [],  # noqa: B006
) -> None:
    """Write a data set as a folder that others can read without this package, and cite."""
    from jobs.verbs.publish.publish import publish as published

    published(dataset, to, licence, author)


@app.command(sort_key=15)
def compare(
    a: Annotated[Local, Parameter(help="Folder of products, folder of a page, or file of Records.")],
    b: Annotated[Local, Parameter(help="Another one; the table shows B relative to A.")],
    *,
    recipe: Annotated[str, Parameter(help="Recipe, if a folder of products has several pages.")] = "",
    other_machine: Annotated[bool, Parameter(help="Allow measurements of different machines.")] = False,
) -> None:
    """Compare two benchmarks and mark significant differences.

    An error differs if it exceeds the interval over queries and the range over trainings.
    """
    from jobs.verbs.compare import compare as compared

    compared(a, b, recipe, other_machine)


@app.command(sort_key=16)
def require(
    scene: Annotated[str, Parameter(help="Name of a scene of the package, or path of an .xml or .toml file.")],
    *,
    error: Annotated[float, Parameter(help="Largest relative RMSE of the colour; .05 is 5 %.")] = float("inf"),
    time: Annotated[float, Parameter(help="Longest time of a frame on one thread, in milliseconds.")] = float("inf"),
    recipe: Annotated[str, Parameter(help="General recipe with a finished page.")] = "quick",
    frames: Annotated[int, Parameter(help="Frames of the camera path that are analysed.")] = 4,
    margin: Annotated[float, Parameter(help="Factor by which the ranges of queries are widened.")] = 1.25,
    method: Annotated[str, Parameter(help="Method of the general recipe; default: the cheapest.")] = "",
    effort: Annotated[float, Parameter(help="Share of its rows per fabric and of its training steps.")] = 0.25,
    set_: Annotated[list[str], Parameter(name="--set", help="Changed option of the method, such as hidden=64.")] = [],  # noqa: B006
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """Analyse the queries of a scene and write the cheapest recipe that meets an error or a time."""
    from jobs.verbs.require import require as required

    required(scene, out, recipe, error, time, frames, margin, method, effort, set_, add)


@app.command(sort_key=17)
def savings(
    recipe: RecipeName,
    scenes: Annotated[list[str], Parameter(help="Scenes whose own recipes, written by `require`, are finished.")],
    *,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """Compare scenes' own recipes with the general one: time and rows saved, and errors."""
    from jobs.verbs.savings import savings as saved

    saved(scenes, out, recipe, add)


@app.command(sort_key=18)
def results(
    recipe: RecipeName,
    *,
    file: Annotated[Local | None, Parameter(help="Markdown file to write; results.md beside the page.")] = None,
    readme: Annotated[Local | None, Parameter(help="Markdown file whose generated table is written anew.")] = None,
    add: Add = NOTHING,
    out: Out = OUT,
) -> None:
    """Write the tables of a recipe's page as Markdown."""
    from jobs.verbs.results import results as written

    written(recipe, out, file, readme, add)


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    given = sys.argv[1:] if tokens is None else tokens
    return run_to_exit(
        lambda: app(given, exit_on_error=False, print_error=False, result_action="return_value"), given, OUT
    )


if __name__ == "__main__":
    sys.exit(main())
