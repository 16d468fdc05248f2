from pathlib import Path

import pytest

from pipeline.atomic import atomic_path, atomic_write
from tests.refusals import refusal


def test_an_error_while_writing_leaves_the_old_file_and_a_file_is_no_folder(tmp_path):
    path = tmp_path / "a.bin"
    atomic_write(path, b"old")
    with pytest.raises(RuntimeError), atomic_path(path) as temporary:
        temporary.write_bytes(b"half")
        raise RuntimeError
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
    atomic_write(path, b"new")
    assert path.read_bytes() == b"new"
    assert list(tmp_path.iterdir()) == [path]
    assert "can be written" in refusal(atomic_write, path / "a.bin", b"")
    for folder in (tmp_path, Path()):
        assert "is a folder: the path of a file is needed" in refusal(atomic_write, folder, b"")
