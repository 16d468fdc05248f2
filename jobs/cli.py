"""Command line of twillight: the verbs in the order of work.

Parameters are declared at the function of a verb, whose module is imported when the verb runs, so that help is fast.
Errors and exit codes are in `jobs.exits`.
"""

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from cyclopts import App, Parameter

from jobs.exits import run_to_exit
from jobs.verbs.parameters import OUT

VERBS: Final[dict[str, Any]] = tomllib.loads(Path(__file__).with_name("verbs.toml").read_text(encoding="utf-8"))
"""The verbs by their names: `function`, `help` and `examples`; of the first of two words also the help, `group`."""


def _version() -> str:
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
groups = {"": app}
for order, (verb, entry) in enumerate(VERBS.items()):
    parent, _, name = verb.rpartition(" ")
    if parent not in groups:
        app.command(group := App(name=parent, help=entry["group"], sort_key=order))
        groups[parent] = group
    calls = "\n".join(f"    twillight {verb} {tokens}".rstrip() for tokens in entry["examples"])
    groups[parent].command(
        f"jobs.verbs.{entry['function']}",
        name=name,
        help=entry["help"],
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
