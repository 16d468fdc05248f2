"""Descriptions of a published data set: card (`README.md`) with the header of data hubs, `CITATION.cff`, Croissant 1.0.

`croissant.json` has the columns and files for tools that load them: one record set for each role and split, made from
the Arrow schema of the rows and the meanings in it.
"""

import json
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import yaml
from packaging.licenses import InvalidLicenseExpression, canonicalize_license_expression

from jobs.verbs.publish.contents import POPULATIONS, About, stem
from pipeline.shards.pieces import columns_joined
from weaves.errors import BadInput, nearest

LOADER: Final = Path(__file__).with_name("load.py.txt")
_TEMPLATE: Final = Path(__file__).with_name("card.md")

_OF_HUBS: Final = {
    **dict.fromkeys(("CC0-1.0", "CC-BY-4.0", "CC-BY-SA-4.0", "CC-BY-NC-4.0", "CC-BY-NC-SA-4.0", "MIT", "Apache-2.0")),
    "ODbL-1.0": "odbl",
    "ODC-By-1.0": "odc-by",
    "PDDL-1.0": "pddl",
}
"""Common licences of data, with the hubs' name if it is not the identifier in small letters."""

_ROLES: Final = {
    "seen": "named fabrics, for training and measurements",
    "population": "random fabrics, for training",
    "unseen": "named fabrics that no general model is trained on",
    "unseen_population": "random fabrics that no model is trained on",
}

_BOUNDS: Final = ("1K", "10K", "100K", "1M", "10M", "100M", "1B", "10B", "100B")
_SIZES: Final = ("n<1K", *(f"{low}<n<{high}" for low, high in pairwise(_BOUNDS)))
"""The hubs' classes of size: below a thousand rows, then a class for each digit more."""


_CR: Final = (
    "column conformsTo dataType extract field fileObject fileProperty fileSet format includes isLiveDataset jsonPath "
    "key md5 parentField path recordSet references regex repeated replace samplingRate separator source subField "
    "transform citeAs equivalentProperty"
)

_CONTEXT: Final = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    **{term: f"cr:{term}" for term in _CR.split()},
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "sc": "https://schema.org/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
}

_TYPES: Final = {"string": "sc:Text", "float": "sc:Float", "int32": "sc:Integer"}  # by those of Arrow


def licence_id(given: str | None) -> str:
    """Return an SPDX identifier as it is written; BadInput if none is given, or there is no such licence."""
    if not given:
        allowed = "an SPDX identifier such as CC-BY-4.0 is needed: without a licence nobody may use the data"
        raise BadInput("publish", "", "--licence is missing", allowed)
    try:
        if not re.fullmatch(r"[A-Za-z0-9.-]{1,60}", given) or given.lower().startswith("licenseref-"):
            raise InvalidLicenseExpression(given)
        return str(canonicalize_license_expression(given))
    except InvalidLicenseExpression as error:
        allowed = f"the SPDX identifier of one licence is needed; {nearest(given, _OF_HUBS)}"
        raise BadInput("publish", "--licence", given, allowed) from error


def _licence_url(licence: str) -> str:
    return f"https://spdx.org/licenses/{licence}.html"


def _hub_licence(licence: str) -> dict[str, str]:
    if licence in _OF_HUBS:
        return {"license": _OF_HUBS[licence] or licence.lower()}
    return {"license": "other", "license_name": licence.lower(), "license_link": _licence_url(licence)}


def card(about: About) -> str:
    """Return the text of the card."""
    manifest = about.manifest
    files = [("role", "split", "fabrics", "rows", "files", "meaning of the role")]
    for role, split in about.sets:
        parts = [part for part in about.parts if (part.role, part.split) == (role, split)]
        fabrics = sum(len(part.fabrics) for part in parts)
        rows = sum(part.rows for part in parts)
        files.append((role, split, f"{fabrics:,}", f"{rows:,}", f"`{stem(role, split)}-*.parquet`", _ROLES[role]))
    named = ", ".join(f"`{name}`" for name in manifest.names("seen", "unseen"))
    populations = [(role, len(manifest.names(role))) for role in POPULATIONS]
    random = "".join(f"; `{role}.toml` has {count:,} random ones" for role, count in populations if count)
    text = _TEMPLATE.read_text(encoding="utf-8").format(
        title=about.citation.title,
        summary=about.summary,
        truth_version=about.truth_version,
        files=_table(files),
        fabrics=f"`fabrics/` has a file for each named fabric ({named}){random}.",
        columns=_table([("column", "type", "meaning"), *((f"`{c}`", kind, m) for c, kind, m in columns_joined())]),
        options=_table([("option", "value"), *_options(manifest.about)]),
        licence=about.licence,
        url=_licence_url(about.licence),
        reference=about.citation.line(about.version),
        bibtex=about.citation.bibtex(about.id, about.version),
        fingerprint=manifest.fingerprint,
    )
    return f"---\n{yaml.safe_dump(_header(about), sort_keys=False, allow_unicode=True)}---\n{text}"


def _header(about: About) -> dict[str, Any]:
    """Return what data hubs read."""
    size = _SIZES[max(0, len(str(about.rows)) - 3)]
    configs: dict[str, dict[str, Any]] = {}
    for role, split in about.sets:
        config = configs.setdefault(role, {"config_name": role, "data_files": []})
        config["data_files"].append({"split": split, "path": f"{stem(role, split)}-*.parquet"})
    next(iter(configs.values()))["default"] = True
    return {
        "pretty_name": about.citation.title,
        **_hub_licence(about.licence),
        "size_categories": [size],
        "tags": ["rendering", "appearance", "bsdf", "woven-cloth", "tabular"],
        "configs": list(configs.values()),
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


def citation_file(about: About) -> str:
    """Return the text of ``CITATION.cff``, in the Citation File Format 1.2."""
    cited = about.citation
    number = {"type": "other", "value": about.manifest.fingerprint, "description": "Fingerprint of all that shaped it"}
    known = {"date-released": cited.date, "url": cited.url, "doi": cited.doi}
    content = {
        "cff-version": "1.2.0",
        "message": "If you use this data set, please cite it as below.",
        "type": "dataset",
        "title": cited.title,
        "authors": [{"family-names": f, "given-names": g} if g else {"name": f} for f, g in cited.persons],
        **{name: value for name, value in known.items() if value},
        "abstract": about.summary,
        "version": about.version,
        "license": about.licence,
        "keywords": ["woven cloth", "appearance", "BSDF", "rendering", "ground truth"],
        "identifiers": [number],
    }
    return str(yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=120))


def croissant(about: About) -> str:
    """Return the text of ``croissant.json``."""
    doi = about.citation.doi
    known = {
        "datePublished": about.citation.date,
        "url": about.citation.url,
        "sameAs": doi and f"https://doi.org/{doi}",
    }
    content = {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": about.citation.title,
        "description": about.summary,
        "license": _licence_url(about.licence),
        "creator": [
            {"@type": "sc:Person", "name": f"{given} {family}", "familyName": family, "givenName": given}
            if given
            else {"@type": "sc:Organization", "name": family}
            for family, given in about.citation.persons
        ],
        **{key: value for key, value in known.items() if value},
        "version": about.version,
        "citeAs": about.citation.bibtex(about.id, about.version),
        "distribution": [_file_set(role, split) for role, split in about.sets],
        "recordSet": [_record_set(role, split) for role, split in about.sets],
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _file_set(role: str, split: str) -> dict[str, Any]:
    return {
        "@type": "cr:FileSet",
        "@id": f"files-{role}-{split}",
        "name": f"files-{role}-{split}",
        "description": f"Rows of {role} fabrics, split {split}.",
        "encodingFormat": "application/x-parquet",  # readers do not know application/vnd.apache.parquet
        "includes": f"{stem(role, split)}-*.parquet",
    }


def _record_set(role: str, split: str) -> dict[str, Any]:
    name = f"{role}-{split}"
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"{name}/{column}",
            "name": f"{name}/{column}",
            "description": meaning,
            "dataType": _TYPES[kind],
            "source": {"fileSet": {"@id": f"files-{name}"}, "extract": {"column": column}},
        }
        for column, kind, meaning in columns_joined()
    ]
    description = f"One query and its answer in each row: {role} fabrics, split {split}."
    return {"@type": "cr:RecordSet", "@id": name, "name": name, "description": description, "field": fields}
