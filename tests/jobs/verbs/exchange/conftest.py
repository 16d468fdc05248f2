"""The command line in a folder of its own."""

import pytest

from jobs.cli import main


@pytest.fixture
def twillight(capsys, monkeypatch, tmp_path):
    """Run the command line; return exit code, output and complaint."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")

    def call(*tokens):
        code = main([*tokens])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return call
