"""The version stands in pyproject.toml and at the top of the CHANGELOG; both are the same."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_the_changelog_begins_with_the_package_version():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    first = re.search(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert first and first[1] == version
