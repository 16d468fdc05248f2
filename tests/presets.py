"""Cases that only the slow lane runs, and presets for parametrised tests: five that differ in kind in every run."""

import pytest

from weaves.fabric import preset_names


def slow(*values):
    """Return a case of a parametrised test that only the slow lane runs."""
    return pytest.param(*values, marks=pytest.mark.slow)


KINDS = ("polyester_lining", "silk_charmeuse", "voile", "gingham", "crepe")
"""Plain, satin, open, coloured, and one of 256 cells."""

PRESETS = [name if name in KINDS else slow(name) for name in preset_names()]
"""All presets, those of `KINDS` in the quick lane."""
