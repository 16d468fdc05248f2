import pytest

from reports.page.files import FILES, read_files, write_files
from tests.refusals import refusal

ABC = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"  # SHA-256 of "abc", FIPS 180-4


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "figures").mkdir()
    for name in ("records.json", "figures/a.png"):
        (tmp_path / name).write_text("abc")
    return tmp_path


def test_what_is_listed_is_read_and_files_of_an_earlier_page_are_removed(folder):
    write_files(folder, ["records.json", "figures/a.png"])
    assert read_files(folder) == {"figures/a.png": ABC, "records.json": ABC}
    (folder / "results.md").write_text("by another hand")
    write_files(folder, ["records.json"])
    assert sorted(path.name for path in folder.rglob("*.*")) == [FILES, "records.json", "results.md"]
    (folder / "records.json").write_text("changed since")
    write_files(folder, [])
    assert (folder / "records.json").read_text() == "changed since"


@pytest.mark.parametrize("content", ["", "[]", '{"a": 1}', '{"../a": "b"}', '{"/a": "b"}'])
def test_what_is_no_list_is_bad_input(folder, content):
    assert "files.json: does not exist" in refusal(read_files, folder)
    (folder / FILES).write_text(content)
    assert "files.json" in refusal(read_files, folder)
    write_files(folder, ["records.json"])
    assert (folder / "figures" / "a.png").exists()
