"""The pages of `docs` by task: their commands are run in order, and print what the page shows."""

import doctest
import re
import shlex
from pathlib import Path

import pytest

from jobs.cli import main

ROOT = Path(__file__).parents[1]


def steps(page):
    """Return the commands of a page, each with what it prints."""
    blocks = re.findall(r"^```console\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S)
    calls = [call.partition("\n") for block in blocks for call in re.split(r"^\$ ", block, flags=re.M)[1:]]
    return [(shlex.split(command), printed) for command, _, printed in calls]


@pytest.mark.parametrize("name", ["weaving_draft"])
def test_a_page_can_be_followed_word_for_word(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    (tmp_path / "weaves").symlink_to(ROOT / "weaves")
    found = steps(ROOT / "docs" / f"{name}.md")
    assert len(found) >= 4
    same = doctest.OutputChecker().check_output
    for (program, *tokens), printed in found:
        assert (program, main(tokens)) == ("twillight", 0)
        shown = capsys.readouterr()
        assert printed and same(printed, shown.out, doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE), shown.out
        assert not shown.err
