import os

import pytest

from tests.refusals import refusal
from weaves.errors import BadInput, one_line
from weaves.reading import MOST_KEYS, MOST_VALUES, read_bytes, read_json, refuse_irregular


def test_a_regular_file_up_to_the_limit_is_read_and_an_object_may_be_wide_where_it_is_said(tmp_path):
    (tmp_path / "a").write_bytes(b"12345")
    (tmp_path / "link").symlink_to("a")
    assert read_bytes(tmp_path / "a", 5, "a file") == read_bytes(tmp_path / "link", 5, "a file") == b"12345"
    assert "has 5 bytes: at most 4 are allowed" in refusal(read_bytes, tmp_path / "a", 4, "a file")
    with pytest.raises(FileNotFoundError):
        read_bytes(tmp_path / "b", 4, "a file")
    assert one_line("a\x1b[2J\nb\tc") == "a·[2J b c"
    assert one_line("abcdef", 4) == "abc…" and one_line("abcdef", 4, keep="end") == "…def"
    assert len(one_line("x" * 10**6)) == 300
    assert len(str(BadInput("w" * 10**5, "k" * 10**5, ["v" * 10**5] * 100, "a" * 10**5))) == 300
    wide = {str(index): 0 for index in range(MOST_KEYS + 1)}
    (tmp_path / "a.json").write_text(f'{{"a": {str(wide).replace(chr(39), chr(34))}}}')
    assert read_json(tmp_path / "a.json", 1 << 20, "a file", {"a": MOST_KEYS + 1}) == {"a": wide}


@pytest.mark.parametrize(("name", "words"), [("pipe", "is a pipe"), (".", "director"), ("zero", "is a device")])
def test_nothing_else_is_opened(tmp_path, name, words):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    assert words in refusal(read_bytes, tmp_path / name, 100, "a file")
    assert words.replace("director", "is a folder") in refusal(refuse_irregular, tmp_path / name, "a file")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "broken JSON"),
        ("[" * 100_000, "nested too deeply"),
        (b"\xff", "broken JSON"),
        ("[" + "0," * (MOST_VALUES + 1) + "0]", "values"),
        ('{"a": {' + ",".join(f'"{i}": 0' for i in range(MOST_KEYS + 1)) + "}}", "an object 'a' with 257 keys"),
        ("[{" + ",".join(f'"{i}": 0' for i in range(MOST_KEYS + 1)) + "}]", "an object with 257 keys"),
    ],
)
def test_json_that_would_take_too_much_is_one_sentence(tmp_path, content, words):
    (tmp_path / "a.json").write_bytes(content if isinstance(content, bytes) else content.encode())
    assert words in refusal(read_json, tmp_path / "a.json", 1 << 24, "a file")
