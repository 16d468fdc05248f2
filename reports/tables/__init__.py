"""Records condensed to frames, tables and sentences.

Frames: summary (a row a method), tradeoff, equal_time, method_choice, compare. table: a table as one object;
page_tables specifies all of them, with words from tables.toml and numbers by number_format. sentences: what sums them
up. documents: README.md's table and reports/RESULTS.md.
"""
