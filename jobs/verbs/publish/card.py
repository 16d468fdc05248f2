"""Card of a published data set (`README.md`) with the header that data hubs read, `load.py` and `CITATION.cff`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import yaml

from jobs.verbs.publish.contents import POPULATIONS, About
from jobs.verbs.publish.licence import hub_licence, licence_url
from pipeline.shards.joined import columns_joined

LOADER: Final = '''"""Rows as a pandas frame: load("seen", "test", "denim"), or: python load.py seen test denim"""
import sys
from pathlib import Path

import pandas as pd

def load(role, split, *fabrics):
    files = sorted((Path(__file__).parent / "data" / role).glob(f"{split}-*.parquet"))
    rows = pd.concat([pd.read_parquet(file) for file in files], ignore_index=True)
    return rows[rows["fabric"].isin(fabrics)] if fabrics else rows

if __name__ == "__main__":
    print(load(*sys.argv[1:]).describe().T)
'''

_ROLES: Final = {
    "seen": "named fabrics, for training and measurements",
    "population": "random fabrics, for training",
    "unseen": "named fabrics that no general model is trained on",
    "unseen_population": "random fabrics that no model is trained on",
}

_SIZES: Final = ((10**3, "n<1K"), (10**4, "1K<n<10K"), (10**5, "10K<n<100K"), (10**6, "100K<n<1M"))
_LARGER: Final = ((10**7, "1M<n<10M"), (10**8, "10M<n<100M"), (10**9, "100M<n<1B"), (10**10, "1B<n<10B"))

_TEXT: Final = """
# {title}

{summary}

It was computed by Twillight, version {truth_version} of its ground truth. It is a model of cloth, not a measurement of one. `recipe.toml` generates it again, from the fabrics in `fabrics/`.

## Files

{files}

`manifest.json` lists every file with its SHA-256, its rows and its fabrics. {fabrics}

## Reading

`load.py` is a loader for pandas. Any reader of Parquet does as well:

```sql
SELECT fabric, avg(diffuse_warp) FROM 'data/*/test-*.parquet' GROUP BY fabric;  -- DuckDB
```

`croissant.json` describes files and columns for tools that load data sets.

## Columns

Directions are unit vectors in the frame of the cloth: weft yarns along x, warp yarns along y, z up. `wi` points to the light, `wo` to the viewer. Components have unit colour and include the incident cosine. The BSDF in RGB is their sum, each times a colour of `fabrics/`: `specular` or `diffuse` of the warp or the weft, and `diffuse_transmission` where light and viewer are on different sides (`wi_z` and `wo_z` of different sign). There, three numbers are linear RGB, and `#rrggbb` is sRGB.

{columns}

## Accuracy

Options of the ground truth:

{options}

The standard error of a row is calibrated: over many rows, it is the root mean square of the true errors. 99.7 % of the errors are below the bound.

## Licence and citation

Licence: [{licence}]({url}). `CITATION.cff` says how to cite the data set; its version is {version}, its fingerprint `{fingerprint}`.
"""  # noqa: E501, a paragraph is a line


def card(about: About) -> str:
    """Return the text of the card."""
    manifest = about.manifest
    files = [("role", "split", "fabrics", "rows", "files", "meaning of the role")]
    for role, splits in about.configs.items():
        for split in splits:
            parts = [part for part in about.parts if (part.role, part.split) == (role, split)]
            fabrics = sum(len(part.fabrics) for part in parts)
            rows = sum(part.rows for part in parts)
            place = f"`data/{role}/{split}-*.parquet`"
            files.append((role, split, f"{fabrics:,}", f"{rows:,}", place, _ROLES[role]))
    named = ", ".join(f"`{name}`" for name in manifest.names("seen", "unseen"))
    populations = [(role, len(manifest.names(role))) for role in POPULATIONS]
    random = "".join(f"; `{role}.toml` has {count:,} random ones" for role, count in populations if count)
    text = _TEXT.format(
        title=about.title,
        summary=about.summary,
        truth_version=about.truth_version,
        files=_table(files),
        fabrics=f"`fabrics/` has a file for each named fabric ({named}){random}.",
        columns=_table([("column", "type", "meaning"), *((f"`{c}`", kind, m) for c, kind, m in columns_joined())]),
        options=_table([("option", "value"), *_options(manifest.about)]),
        licence=about.licence,
        url=licence_url(about.licence),
        version=about.version,
        fingerprint=manifest.fingerprint,
    )
    return f"---\n{yaml.safe_dump(_header(about), sort_keys=False, allow_unicode=True)}---\n{text}"


def _header(about: About) -> dict[str, Any]:
    """Return what data hubs read."""
    size = next((name for most, name in (*_SIZES, *_LARGER) if about.rows < most), "n>1T")
    configs: list[dict[str, Any]] = [
        {
            "config_name": role,
            "data_files": [{"split": split, "path": f"data/{role}/{split}-*.parquet"} for split in splits],
        }
        for role, splits in about.configs.items()
    ]
    configs[0]["default"] = True
    return {
        "pretty_name": about.title,
        **hub_licence(about.licence),
        "size_categories": [size],
        "tags": ["rendering", "appearance", "bsdf", "woven-cloth", "tabular"],
        "configs": configs,
    }


def _options(about: dict[str, Any]) -> list[tuple[str, str]]:
    """Return the options of the truth, and those of training rows that differ."""
    truth = about.get("truth") or {}
    rows = [(f"`{name}`", str(value)) for name, value in truth.items()]
    training = about.get("training_truth") or {}
    return rows + [(f"`{k}`, training rows", str(value)) for k, value in training.items() if truth.get(k) != value]


def _table(rows: Sequence[tuple[str, ...]]) -> str:
    """Return a Markdown table; the first row is its head."""
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]])


def citation(about: About) -> str:
    """Return the text of ``CITATION.cff``, in the Citation File Format 1.2."""
    content = {
        "cff-version": "1.2.0",
        "message": "If you use this data set, please cite it as below.",
        "type": "dataset",
        "title": about.title,
        "authors": [{"name": name} for name in about.authors],
        "abstract": about.summary,
        "version": about.version,
        "license": about.licence,
        "keywords": ["woven cloth", "appearance", "BSDF", "rendering", "ground truth"],
        "identifiers": [
            {"type": "other", "value": about.manifest.fingerprint, "description": "Fingerprint of all that shaped it"}
        ],
    }
    return str(yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=120))
