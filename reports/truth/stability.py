"""Numerical stability of the model at its extremes: float32 against float64, float64 against 50 digits."""

from __future__ import annotations

from collections.abc import Callable

from reports.truth import stability_cloth, stability_point
from reports.truth.finding import Finding


def stability(progress: Callable[[str], None] = lambda about: None) -> list[Finding]:
    """Compute every expression over its corners; the same findings every time.

    Parameters
    ----------
    progress : callable
        Receives the name of the next expression.
    """
    findings: list[Finding] = []
    for about, part in {**stability_point.PARTS, **stability_cloth.PARTS}.items():
        progress(about)
        findings += part()
    return findings
