"""A fabric from what was measured on a cloth, and what it predicts of what was kept back.

straight: light straight through, which gives widths, bends and reliefs. scattered: what yarns scatter, which gives
roughnesses and colours. fit_bsdf for a BSDF, fit_sheet for a data_sheet; fitted: what they return. predicted: errors;
held_out: these and those of formulas in use, in tables.
"""
