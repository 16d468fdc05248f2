import pytest

from reports.tables.markdown import block, markdown_table, markers, with_block
from weaves.errors import BadInput

FIRST, LAST = markers("speeds")
TEXT = f"before\n{FIRST}\nold\n{LAST}\nafter\n"


def test_a_table_has_numbers_on_the_right():
    table = markdown_table(("method", "ns"), [("points", "12"), ("woven", "3")])
    assert table.splitlines() == ["| method | ns |", "| :-- | --: |", "| points | 12 |", "| woven | 3 |"]


def test_a_block_is_replaced_and_nothing_else():
    assert block(TEXT, "speeds", "file") == "old\n"
    assert with_block(TEXT, "speeds", "new\n\n", "file") == f"before\n{FIRST}\nnew\n{LAST}\nafter\n"
    assert with_block(TEXT, "speeds", "old", "file") == TEXT


@pytest.mark.parametrize("text", ["nothing", f"{FIRST}\nno end", f"{LAST}\n{FIRST}\n"])
def test_a_missing_marker_is_named(text):
    with pytest.raises(BadInput, match=r"notes\.md: has no block 'speeds'"):
        block(text, "speeds", "notes.md")
