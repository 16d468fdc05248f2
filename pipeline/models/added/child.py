"""Process for work with a method from outside: ``python -m pipeline.models.added.child PIPE STATE``.

PIPE and STATE are the numbers of open files: a connection that brings the work and takes its result, and the bytes in
which calls are marked (`pipeline.models.added.guarded`).
"""

from __future__ import annotations

import mmap
import os
import sys
import threading
import traceback
from multiprocessing.connection import Connection

from pipeline.models.added.guarded import STATE_BYTES, WATCH
from weaves.errors import BadInput, WorkFailed


def main() -> None:
    """Do the work and send its result; end with the parent process."""
    sys.dont_write_bytecode = True  # nothing is written beside the code of others
    pipe = Connection(int(sys.argv[1]))
    WATCH.attach(mmap.mmap(int(sys.argv[2]), STATE_BYTES))
    function, arguments = pipe.recv()
    threading.Thread(target=_end_with_parent, args=(pipe,), daemon=True).start()
    try:
        result = "result", function(*arguments, lambda share: pipe.send(("share", float(share))))
    except (BadInput, WorkFailed) as error:
        result = "raised", error
    except BaseException:
        result = "crashed", traceback.format_exc()
    pipe.send(result)
    os._exit(0)  # threads that a method has left running do not hold the process


def _end_with_parent(pipe: Connection) -> None:
    try:
        pipe.recv()
    except (EOFError, OSError):
        os._exit(1)


if __name__ == "__main__":
    main()
