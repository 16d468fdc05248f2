"""`CITATION.cff`: how to cite a published data set, in the Citation File Format 1.2."""

from __future__ import annotations

import yaml

from jobs.verbs.publish.about import About


def citation(about: About) -> str:
    """Return the file's text."""
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
