"""Records condensed into tables and sentences.

summary (a row a method), tradeoff and pareto_front, equal_time, compare, method_choice; rows of the page's tables
(method_rows, scene_rows, truth_rows, number_format); its sentences (headline, sentences, caveats, machine_load).
As Markdown: readme (the table of README.md) and results (reports/RESULTS.md), with markdown for tables and blocks.
"""
