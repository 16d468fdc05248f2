from reports.page.html import alt_texts
from reports.tables.page_tables import page_frames, ranged_frames
from reports.tables.table import WORDS


def test_plots_are_described_with_their_fronts_and_their_lowest_and_highest_values(page_input):
    """Made up: points of k cost 400 k and err 1/k; woven costs as points of 9; NeuMIP as woven, and is not faster."""
    texts = alt_texts(ranged_frames(page_frames(page_input.records)))
    texts = {name: text.replace("\u00a0", " ") for name, text in texts.items()}
    assert texts.keys() == WORDS["plots"].keys() and all(text.endswith(".") for text in texts.values())
    assert "On the front, seen fabrics: points, k = 1, points, k = 2" in texts["error-against-time"]
    assert "woven" in texts["error-against-time"] and "NeuMIP" not in texts["error-against-time"]
    assert "Lowest: points, k = 1 (420 ns); highest: points, k = 64" in texts["timing"]
    assert "Lowest, seen fabrics: points, k = 64" in texts["errors"]
