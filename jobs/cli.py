"""Command line of twillight: the verbs in the order of work.

Parameters are declared at the function of a verb, whose module is imported when the verb runs, so that help is fast.
Errors and exit codes are in `jobs.exits`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Final, NamedTuple

from cyclopts import App, Parameter

from jobs.exits import run_to_exit
from jobs.verbs.parameters import OUT


class VerbEntry(NamedTuple):
    """A verb in the help."""

    function: str
    """Module of `jobs.verbs` and its function."""
    line: str
    """Its purpose."""
    examples: tuple[str, ...]
    """Arguments of calls that its help shows."""


VERBS: Final = {
    "list": VerbEntry(
        "list:print_lists",
        "List the fabrics and the recipes of the package, or make pictures of the fabrics.",
        ("", "--pictures presets"),
    ),
    "import": VerbEntry(
        "exchange:import_draft",
        "Make a fabric from the draft file of a weaving program.",
        ("draft.wif --out my.toml", "draft.wif --out my.toml --like denim --ends 1-96 --warp.width 0.9"),
    ),
    "show": VerbEntry(
        "show:show",
        "Show a fabric: its drawdown and its yarns.",
        ("denim", "my.toml --out pictures", "denim --out pictures --maps --size 1200x900"),
    ),
    "export": VerbEntry(
        "exchange:export_fabric",
        "Write a fabric for other programs: a mesh, a draft, texture maps and materials, a shader, or a BSDF.",
        (
            "denim --maps denim-maps --size 1024",
            "denim --mesh denim.ply",
            "denim --shader denim-shader",
            "voile --bsdf voile.xml",
        ),
    ),
    "gallery": VerbEntry(
        "gallery:gallery",
        "Write a site of fabrics: pictures, live pages, maps, samples, shaders, files.",
        ("--out site",),
    ),
    "view": VerbEntry(
        "exchange:view",
        "Write a page of one file that draws a fabric while light and viewer turn, and compares methods.",
        ("denim --out denim.html",),
    ),
    "render": VerbEntry(
        "render:render",
        "Render a scene with any fabrics by any method.",
        ("drape --out drape.png", "drape --fabric denim --size 1024x1024 --samples 4 --out denim.png"),
    ),
    "plan": VerbEntry(
        "plan:print_plan",
        "Show what would run and why, with rows, bytes and time; nothing is computed.",
        ("quick", "quick --workers 64"),
    ),
    "generate": VerbEntry(
        "run:generate", "Compute the ground truth: the shards of a recipe's data set.", ("quick", "my.toml --workers 4")
    ),
    "evaluate": VerbEntry(
        "evaluate:evaluate",
        "Evaluate a file of queries on a fabric: its rows with the BSDF values.",
        ("denim queries.parquet --out answers.parquet", "denim queries.parquet --out fast.parquet --model selvage"),
    ),
    "check": VerbEntry(
        "check:check",
        "Check all files of a recipe, the shards of a data set, or the ground truth of a fabric.",
        ("quick", "quick --repair", "denim"),
    ),
    "train": VerbEntry("run:train", "Train the models of a recipe on its data set.", ("quick",)),
    "bench": VerbEntry(
        "run:bench",
        "Measure error, aliasing and time of every method; the recipes `truth` and `mitsuba`: the truth, Mitsuba.",
        ("quick", "truth"),
    ),
    "report": VerbEntry("run:report", "Write the page: pictures, tables and plots of all measurements.", ("quick",)),
    "run": VerbEntry(
        "run:run",
        "Generate, train, bench and report; finished tasks are skipped.",
        ("quick", "quick --add method.py:Method", "standard --out s3://bucket/standard --progress plain"),
    ),
    "status": VerbEntry(
        "plan:print_status", "Show which tasks are done, failed (with the reason) or missing.", ("quick",)
    ),
    "prune": VerbEntry(
        "prune:prune",
        "List, or remove, the products that none of some recipes needs.",
        ("quick standard", "quick standard --delete"),
    ),
    "merge": VerbEntry(
        "merge:merge",
        "Join two folders of products, such as parts of a data set made on two machines.",
        ("here there --out both",),
    ),
    "records merge": VerbEntry(
        "records:merge_records",
        "Join Records of several machines in one file; times of each stay apart.",
        ("here there --out both.json",),
    ),
    "publish": VerbEntry(
        "publish.publish:publish",
        "Write a data set as a folder that others can read without this package, and cite.",
        (
            'out/datasets/NAME --to shelf --licence CC-BY-4.0 --author "Weaver, Ada"',
            'out/datasets/NAME --to shelf --licence CC-BY-4.0 --title "Eight cloths" --doi 10.5281/zenodo.123',
        ),
    ),
    "compare": VerbEntry(
        "records:compare",
        "Compare two benchmarks and mark significant differences.\n\n"
        "An error differs if it exceeds the interval over queries and the range over trainings.",
        ("before after", "before after --recipe quick"),
    ),
    "require": VerbEntry(
        "require:require",
        "Analyse the queries of a scene and write the cheapest recipe that meets an error or a time.",
        ("drape --error 0.05", "my-scene.xml --recipe standard --time 40"),
    ),
    "savings": VerbEntry(
        "savings:savings",
        "Compare scenes' own recipes with the general one: time and rows saved, and errors.",
        ("standard sphere",),
    ),
    "results": VerbEntry(
        "records:results",
        "Write the tables of a recipe's page as Markdown.",
        ("quick", "quick --file RESULTS.md"),
    ),
}
"""The verbs by their names, in the order of work."""


def _version() -> str:
    """Return the version of the package that is installed."""
    from importlib.metadata import version

    return f"twillight {version('twillight')}"


app = App(
    name="twillight",
    help="Woven cloth at every scale, from a weave draft to the light it returns: "
    "ground truth, neural models, and a benchmark of their errors and times.",
    version=_version,
    suppress_keyboard_interrupt=False,
    group_commands="Verbs, in the order of work",
    default_parameter=Parameter(negative=()),
)
for order, (verb, entry) in enumerate(VERBS.items()):
    parent, _, name = verb.rpartition(" ")
    group = app
    if parent:
        app.command(group := App(name=parent, help="Join Records of several machines.", sort_key=order))
    calls = "\n".join(f"    twillight {verb} {tokens}".rstrip() for tokens in entry.examples)
    group.command(
        f"jobs.verbs.{entry.function}",
        name=name,
        help=entry.line,
        help_epilogue=f"Examples:\n\n{calls}",
        sort_key=order,
    )
app.register_install_completion_command(help="Install completion of verbs and options for bash, zsh or fish.")


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    given = sys.argv[1:] if tokens is None else tokens
    return run_to_exit(
        lambda: app(given, exit_on_error=False, print_error=False, result_action="return_value"), given, OUT
    )


if __name__ == "__main__":
    sys.exit(main())
