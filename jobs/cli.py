"""Command line of twillight: the verbs in the order of work.

Parameters are declared at the function of a verb, whose module is imported when the verb runs, so that help is fast.
Errors and exit codes are in `jobs.exits`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Final

from cyclopts import App, Parameter

from jobs.exits import run_to_exit
from jobs.verbs.parameters import OUT

VERBS: Final = {
    "list": ("list:print_lists", "List the fabrics and the recipes of the package, or make pictures of the fabrics."),
    "import": ("exchange:import_draft", "Make a fabric from the draft file of a weaving program."),
    "show": ("show:show", "Show a fabric: its drawdown and its yarns."),
    "export": (
        "exchange:export_fabric",
        "Write a fabric for other programs: a mesh, a draft, texture maps and materials, or a shader.",
    ),
    "gallery": ("gallery:gallery", "Write a site of fabrics: pictures, live pages, maps, samples, shaders, files."),
    "view": (
        "exchange:view",
        "Write a page of one file that draws a fabric while light and viewer turn, and compares methods.",
    ),
    "render": ("render:render", "Render a scene with any fabrics by any method."),
    "plan": ("plan:print_plan", "Show what would run and why, with rows, bytes and time; nothing is computed."),
    "generate": ("run:generate", "Compute the ground truth: the shards of a recipe's data set."),
    "evaluate": ("evaluate:evaluate", "Evaluate a file of queries on a fabric: its rows with the BSDF values."),
    "check": ("check:check", "Check all files of a recipe, the shards of a data set, or the ground truth of a fabric."),
    "train": ("run:train", "Train the models of a recipe on its data set."),
    "bench": (
        "run:bench",
        "Measure error, aliasing and time of every method; the recipes `truth` and `mitsuba`: the truth, Mitsuba.",
    ),
    "report": ("run:report", "Write the page: pictures, tables and plots of all measurements."),
    "run": ("run:run", "Generate, train, bench and report; finished tasks are skipped."),
    "status": ("plan:print_status", "Show which tasks are done, failed (with the reason) or missing."),
    "prune": ("prune:prune", "List, or remove, the products that none of some recipes needs."),
    "merge": ("merge:merge", "Join two folders of products, such as parts of a data set made on two machines."),
    "records merge": (
        "records:merge_records",
        "Join Records of several machines in one file; times of each stay apart.",
    ),
    "publish": (
        "publish.publish:publish",
        "Write a data set as a folder that others can read without this package, and cite.",
    ),
    "compare": (
        "records:compare",
        "Compare two benchmarks and mark significant differences.\n\n"
        "An error differs if it exceeds the interval over queries and the range over trainings.",
    ),
    "require": (
        "require:require",
        "Analyse the queries of a scene and write the cheapest recipe that meets an error or a time.",
    ),
    "savings": (
        "savings:savings",
        "Compare scenes' own recipes with the general one: time and rows saved, and errors.",
    ),
    "results": ("records:results", "Write the tables of a recipe's page as Markdown."),
}
"""Function of each verb, in a module of `jobs.verbs`, and its line in the help."""

app = App(
    name="twillight",
    help="Woven cloth at every scale, from a weave draft to the light it returns: "
    "ground truth, neural models, and a benchmark of their errors and times.",
    version_flags=(),
    suppress_keyboard_interrupt=False,
    group_commands="Verbs, in the order of work",
    default_parameter=Parameter(negative=()),
)
for order, (verb, (function, line)) in enumerate(VERBS.items()):
    parent, _, name = verb.rpartition(" ")
    group = app
    if parent:
        app.command(group := App(name=parent, help="Join Records of several machines.", sort_key=order))
    group.command(f"jobs.verbs.{function}", name=name, help=line, sort_key=order)


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    given = sys.argv[1:] if tokens is None else tokens
    return run_to_exit(
        lambda: app(given, exit_on_error=False, print_error=False, result_action="return_value"), given, OUT
    )


if __name__ == "__main__":
    sys.exit(main())
