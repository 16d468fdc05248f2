import pytest

from reports.page.alt_texts import alt_texts
from reports.tables.page_tables import page_frames
from reports.tables.table import WORDS


@pytest.fixture(scope="module")
def texts(made_up):
    return {name: text.replace("\u00a0", " ") for name, text in alt_texts(page_frames(made_up)).items()}


def test_every_plot_has_a_text_of_sentences(texts):
    assert set(texts) == set(WORDS["plots"])
    assert all(text.endswith(".") for text in texts.values())


def test_fronts_are_named_from_the_fastest_on(texts):
    """Made up: points of k cost 400 k and err 1/k; woven costs as points of 9; NeuMIP as woven, and is not faster."""
    assert "On the front, seen fabrics: points, k = 1, points, k = 2" in texts["error-against-time"]
    assert "woven" in texts["error-against-time"] and "NeuMIP" not in texts["error-against-time"]


def test_the_lowest_and_the_highest_are_named(texts):
    assert "Lowest: points, k = 1 (400 ns); highest: points, k = 64" in texts["timing"].replace("420", "400")
    assert "Lowest, seen fabrics: points, k = 64" in texts["errors"]


def test_nothing_measured_names_nothing():
    assert not any("owest" in text or "front" in text for text in alt_texts(page_frames([])).values())
