"""What `make` installs, with a `pip` that only notes what it was told."""

import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

STUB = """#!/bin/sh
case "$0 $*" in
  *venv\\ .venv) mkdir -p .venv/bin && cp stub .venv/bin/pip && cp stub .venv/bin/python ;;
  *pip*requirements-cpu.txt) {cpu} ;;
  *pip*) echo "$*" >> installed ;;
  *importlib*) test -e cpu ;;
esac
"""


@pytest.mark.parametrize(
    ("cpu", "ends"),
    [
        ("touch cpu", "without CUDA"),
        ("echo 'ERROR: No matching distribution found for torch==2.10.0+cpu' >&2; exit 1", "with CUDA"),
        ("echo 'ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.' >&2; exit 1", "with CUDA"),
        ("kill -9 $$", "with an error"),
        ("kill -15 $$", "with an error"),
        ("echo 'ERROR: Connection broken' >&2; exit 1", "with an error"),
    ],
)
def test_cuda_is_installed_only_where_there_is_no_pytorch_without_it(tmp_path, cpu, ends):
    shutil.copy(ROOT / "Makefile", tmp_path)
    for name in ("requirements.txt", "requirements-cpu.txt", "requirements-cuda.txt", "pyproject.toml"):
        (tmp_path / name).touch()
    (tmp_path / "stub").write_text(STUB.format(cpu=cpu))
    (tmp_path / "stub").chmod(0o755)
    command = ["make", "--silent", "PYTHON=./stub", ".venv/installed"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    installed = (tmp_path / "installed").read_text() if (tmp_path / "installed").exists() else ""
    assert ("requirements-cuda.txt" in installed) == ("three more gigabytes" in done.stdout) == (ends == "with CUDA")
    assert (done.returncode == 0) == (tmp_path / ".venv/installed").exists() == (ends != "with an error"), done
    if ends == "with an error":
        assert "PyTorch is not installed: run make again" in done.stdout and installed == ""
