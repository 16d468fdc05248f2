"""A fabric from what was measured on a cloth, and what it predicts of what was kept back.

straight: light straight through, from which geometry finds widths, bends and reliefs. scattered: what yarns scatter,
from which optics finds roughnesses and colours. fit_bsdf, and fit_sheet for a data_sheet (two_streams: yarns as a
diffusing layer); fitted: what they return. predicted: errors; held_out: these and those of formulas in use, in tables.
"""
