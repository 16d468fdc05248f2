"""Records condensed into tables and sentences: summary, front, trade-off, cells, wording."""
