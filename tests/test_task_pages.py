"""The pages of `docs` by task: their commands are run in order, print what the page shows, and make its pictures.

With TWILLIGHT_WRITE_PICTURES=1 (`make pictures`) the pictures are written to `docs/pictures`, not compared.
"""

import doctest
import os
import re
import shlex
import shutil
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from jobs.cli import main

pytestmark = pytest.mark.external  # commands that take minutes

ROOT = Path(__file__).parents[1]


def steps(page):
    """Return the commands of a page, each with what it prints."""
    blocks = re.findall(r"^```console\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S)
    calls = [call.partition("\n") for block in blocks for call in re.split(r"^\$ ", block, flags=re.M)[1:]]
    return [(shlex.split(command), printed) for command, _, printed in calls]


def check_pictures(page, made):
    """Compare the pictures of a page with those that its commands made, or write them."""
    names = re.findall(r"\]\(pictures/([^)]+)\)", page.read_text(encoding="utf-8"))
    assert names, f"{page.name} shows no picture"
    for name in names:
        kept = page.parent / "pictures" / name
        if os.environ.get("TWILLIGHT_WRITE_PICTURES"):
            kept.parent.mkdir(exist_ok=True)
            shutil.copyfile(made / name, kept)
        new, old = (matplotlib.image.imread(path).astype(float) for path in (made / name, kept))
        assert new.shape == old.shape, f"{name} is out of date: run `make pictures`"
        # Last bits of a processor may round to the next of 256 levels.
        assert np.abs(new - old).mean() < 0.5 / 255, f"{name} is out of date: run `make pictures`"


@pytest.mark.parametrize(("name", "commands"), [("weaving_draft", 4), ("blender", 1)])
def test_a_page_can_be_followed_word_for_word(name, commands, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    (tmp_path / "weaves").symlink_to(ROOT / "weaves")
    found = steps(ROOT / "docs" / f"{name}.md")
    assert len(found) >= commands
    same = doctest.OutputChecker().check_output
    for (program, *tokens), printed in found:
        assert (program, main(tokens)) == ("twillight", 0)
        shown = capsys.readouterr()
        assert printed and same(printed, shown.out, doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE), shown.out
        assert not shown.err
    check_pictures(ROOT / "docs" / f"{name}.md", tmp_path / "pictures")
