"""Extra rows: what a model learns from beside the data set's queries, as its options declare it.

A set of extra rows is a kind and its parameters. Models whose options declare equal sets share the shards.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pipeline.fingerprint import fingerprint
from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.silhouettes import SilhouetteRows

ExtraRows = Annotated[AngularSamples | SilhouetteRows, Field(discriminator="kind")]
"""Any set of extra rows, distinguished by its kind."""


def set_name(rows: ExtraRows) -> str:
    """Return the name of a set in a manifest, where it replaces the split: kind and fingerprint."""
    return f"{rows.kind}-{fingerprint(rows.model_dump(mode='json'), 8)}"
