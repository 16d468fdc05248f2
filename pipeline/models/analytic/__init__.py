"""Methods that learn nothing, one a file: its options, and how it is made from pipeline.analytic.

Plans read options without compilers, so each file imports kernels where the methods are made.
"""
