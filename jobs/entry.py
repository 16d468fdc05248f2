"""Entry of the command line. Ctrl-C gets a sentence from the first moment, while the verbs are still being loaded."""

from __future__ import annotations

import sys


def main() -> int:
    """Load the command line and run it; return its exit code."""
    try:
        from jobs.cli import main as run
    except KeyboardInterrupt:
        print("stopped before any work began", file=sys.stderr)  # noqa: T201, nothing else is loaded
        return 130
    return run()
