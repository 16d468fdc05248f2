import json

import pytest

from tests.jobs import made_up
from tests.jobs.verbs.entries.test_answers import done


@pytest.fixture
def measured(recipe, entry, tmp_path):
    """Return a function that measures an entry, and returns its folder among the products."""
    out = tmp_path / "out"
    made_up.finished(recipe, out, ["generate"])
    return lambda name, **form: (out / done(recipe, entry(name=name, **form), out).records).parent


def test_a_board_has_the_entries_of_each_class(measured, call, tmp_path):
    folders = [measured("small", bytes_stored=4000), measured("large", multiply_adds=100_001), measured("tiny")]
    assert call("challenge", "board", *folders, "--to", "BOARD.md")[0] == 0
    head, *classes = (tmp_path / "BOARD.md").read_text(encoding="utf-8").split("\n## ")
    assert "3 entries" in head and json.loads((folders[0] / "records.json").read_text())
    assert [part.partition("\n")[0] for part in classes] == ["≤ 4 k", "≤ 16 k", "open"]
    for part, name in zip(classes, ("small", "tiny", "large"), strict=True):
        rows = {line.split(" | ")[0] for line in part.splitlines() if line.startswith("| ")}
        assert rows == {"| method", "| :--", f"| {name}"} and "Errors, unseen fabrics: 3 fabrics" in part


def test_what_was_not_measured_or_is_of_other_rows_is_refused(measured, entry, refused, tmp_path):
    small, other = measured("small"), measured("other")
    board = ("challenge", "board", small)
    assert "is the name of another entry" in refused(*board, small, "--to", "a.md")
    assert "records.json" in refused(*board, entry(name="new"), "--to", "a.md")
    text = (other / "records.json").read_text(encoding="utf-8")
    dataset = json.loads(text)[0]["provenance"]["dataset"]
    (other / "records.machine.json").unlink()
    for content, words in (
        (text.replace(dataset, "0" * 16), "that of the entries before"), ("[]", "those of other are needed"),
        (text.replace("without code", "[here](x)"), "states other costs"),
        (text.replace('"fabric": "', '"fabric": "|'), "signs of Markdown"),
        (text.replace("stated_tries", "mse"), "holds other Records"), (text.replace('"other"', '"x"'), "other Records"),
    ):  # fmt: skip
        (other / "records.json").write_text(content, encoding="utf-8")
        assert words in refused(*board, other, "--to", "a.md")
    assert not (tmp_path / "a.md").exists()
