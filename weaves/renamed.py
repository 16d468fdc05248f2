"""Names of earlier versions and their replacements.

An old name is refused, never translated: `replacement` returns the sentence that names the new one. The kind of a name
is the last part of its key in a recipe (``models.0.model`` has the kind ``model``), `SCENE` for a scene and `KEY` for
an option or a key itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

KEY, SCENE = "key", "scene"

RENAMED: Final[Mapping[str, Mapping[str, str]]] = MappingProxyType(
    {
        "model": {"quadrature": "gauss_nodes", "sums": "soft_nodes"},
        "estimator": {"table": "node_table", "elliptic": "auto"},
        SCENE: {"table": "dinner_table"},
        KEY: {},
    }
)
"""New names by kind and old name."""

REMOVED: Final[Mapping[str, Mapping[str, str]]] = MappingProxyType(
    {
        "model": {"table": "use 'soft_nodes' or 'gauss_nodes', or the estimator 'node_table' for the ground truth"},
        SCENE: {},
        KEY: {
            "geometry": "yarns are tori",
            "narrow_nodes": "one rule serves all footprints",
            "seam": "one rule serves all footprints",
        },
    }
)
"""Alternatives to names without a successor, by kind and old name."""


def replacement(kind: str, name: object) -> str:
    """Return the sentence that names the replacement of an old name; empty for any other name."""
    if not isinstance(name, str):
        return ""
    if new := RENAMED.get(kind, {}).get(name):
        return f"{name!r} is now {new!r}"
    if instead := REMOVED.get(kind, {}).get(name):
        return f"{name!r} was removed: {instead}"
    return ""
