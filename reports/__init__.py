"""Measurements, Records, tables and the page.

record: one measured number with its provenance. catalogue: title, definition, unit and format of every metric. options:
choices of the benchmark. error: the error measures. measure (methods) and truth (the ground truth) make Records; images
reads and writes pictures; tables condenses Records; page draws figures and writes the HTML.
"""
