"""Every reference key that a docstring cites stands in BIBLIOGRAPHY.bib."""

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent


def test_cited_keys_are_listed():
    listed = set(re.findall(r"@\w+\{(\w+),", (ROOT / "BIBLIOGRAPHY.bib").read_text()))
    sources = [path for folder in ("weaves", "pipeline", "reports", "jobs") for path in (ROOT / folder).rglob("*.py")]
    cited = {key for path in sources for key in re.findall(r"\[([A-Z][a-z]+\d{4}[A-Za-z]*)\]", path.read_text())}
    assert cited
    assert cited <= listed
