"""Presets for parametrised tests: five that differ in kind in every run, the others where tests may be slow."""

import pytest

from weaves.fabric import preset_names

KINDS = ("polyester_lining", "silk_charmeuse", "voile", "gingham", "crepe")
"""Plain, satin, open, coloured, and one of 256 cells."""

PRESETS = [name if name in KINDS else pytest.param(name, marks=pytest.mark.slow) for name in preset_names()]
"""All presets, those of `KINDS` in the quick lane."""
