import time

import pytest

from pipeline.models.added.apart import run_apart
from pipeline.models.added.guarded import MethodFailed
from tests.pipeline.sent_code import Code
from weaves.errors import WorkFailed

GUARDED = "__import__('pipeline.models.added.guarded', fromlist=['WATCH'])"
BEGIN = f"{GUARDED}.WATCH.mark(1, b'theirs', b'predict', 0.5)"
END = f"{GUARDED}.WATCH.mark(-1, b'theirs', b'predict', 0.5)"


def test_a_call_that_hangs_or_ends_its_process_is_named_and_time_or_a_death_between_calls_blames_no_method():
    start = time.monotonic()
    with pytest.raises(MethodFailed, match=r"^theirs: predict took longer than 0.5 s, its limit$"):
        run_apart(Code(f"lambda progress: [{BEGIN}, __import__('time').sleep(600)]"))
    assert time.monotonic() - start < 300
    with pytest.raises(MethodFailed, match=r"^theirs: predict ended its process \(exit code 3\)$"):
        run_apart(Code(f"lambda progress: [{BEGIN}, __import__('os')._exit(3)]"))
    assert run_apart(Code(f"lambda progress: [{BEGIN}, {END}, __import__('time').sleep(1), 7][3]")) == 7
    with pytest.raises(WorkFailed, match=r"ended \(exit code 9\)") as failure:
        run_apart(Code("lambda progress: __import__('os')._exit(9)"))
    assert not isinstance(failure.value, MethodFailed)
