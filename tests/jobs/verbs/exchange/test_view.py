"""`twillight view` on the command line."""

from jobs.cli import main
from reports.viewer import view
from tests.reports.viewer.conftest import shown_of


def test_a_large_repeat_is_refused_before_any_work(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(view, "MOST_REPEAT_CELLS", 3)
    monkeypatch.setattr(view, "content", None)
    assert main(["view", "gingham", "--out", str(tmp_path / "x.html")]) == 2
    assert "at most 3 cells" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_a_page_is_written_whole(capsys, monkeypatch, tmp_path):
    found = shown_of(0, (2,), (1.0,), 32)
    monkeypatch.setattr(view, "content", lambda fabric, truth: found)
    assert main(["view", "gingham", "--out", str(tmp_path / "a" / "x.html")]) == 0
    assert "5 views" in capsys.readouterr().out
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["x.html"]
