"""Measured cloth that comes with the package; README.md beside it has sources and licence."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

SHADE: Final = Path(__file__).with_name("shade_6216.parquet")
"""A roller shade by a goniophotometer; light at 0, 10, 30, 50 and 70 degrees."""
SCREENS: Final = Path(__file__).with_name("fabrics.csv")
"""Screens and awnings at normal incidence, two bands; empty cells were kept back."""

MEASURED: Final[Mapping[str, Path]] = MappingProxyType({path.stem: path for path in (SHADE, SCREENS)})
"""Files by the names that the command line takes."""
