"""Entry of the command line. Ctrl-C gets a sentence from the first moment, while the verbs are still being loaded.

A part (`--part`) computes on one thread, as workers do: libraries read the number of threads when they are loaded.
"""

import os
import sys


def main() -> int:
    """Load the command line and run it; return its exit code."""
    try:
        if any(flag.partition("=")[0] == "--part" for flag in sys.argv[1:]):
            from pipeline.own_process import ONE_THREAD

            os.environ.update(ONE_THREAD)
        from jobs.cli import main as run
    except KeyboardInterrupt:
        print("stopped before any work began", file=sys.stderr)  # noqa: T201, nothing else is loaded
        return 130
    return run()
