"""`croissant.json`: the columns and files of a published data set for tools that load it, in Croissant 1.0.

One record set for each role and split, made from the Arrow schema of the rows and the meanings in it.
"""

from __future__ import annotations

import json
from typing import Any, Final

from jobs.verbs.publish.card import licence_url
from jobs.verbs.publish.contents import About, stem
from pipeline.shards.pieces import columns_joined

_CR: Final = (
    "column conformsTo dataType extract field fileObject fileProperty fileSet format includes isLiveDataset jsonPath "
    "key md5 parentField path recordSet references regex repeated replace samplingRate separator source subField "
    "transform citeAs equivalentProperty"
)
"""Terms of the vocabulary of Croissant."""

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

_TYPES: Final = {"string": "sc:Text", "float": "sc:Float", "int32": "sc:Integer"}
"""Types of Croissant by those of Arrow."""


def croissant(about: About) -> str:
    """Return the file's text."""
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
        "license": licence_url(about.licence),
        "creator": [
            {"@type": "sc:Person", "name": f"{given} {family}", "familyName": family, "givenName": given}
            if given
            else {"@type": "sc:Organization", "name": family}
            for family, given in about.citation.persons
        ],
        **{key: value for key, value in known.items() if value},
        "version": about.version,
        "citeAs": about.citation.bibtex(about.id, about.version),
        "distribution": [_files(role, split) for role, split in about.sets],
        "recordSet": [_records(role, split) for role, split in about.sets],
    }
    return json.dumps(content, indent=1, ensure_ascii=False) + "\n"


def _files(role: str, split: str) -> dict[str, Any]:
    """Return the files of a role's split."""
    return {
        "@type": "cr:FileSet",
        "@id": f"files-{role}-{split}",
        "name": f"files-{role}-{split}",
        "description": f"Rows of {role} fabrics, split {split}.",
        "encodingFormat": "application/x-parquet",  # readers do not know application/vnd.apache.parquet
        "includes": f"{stem(role, split)}-*.parquet",
    }


def _records(role: str, split: str) -> dict[str, Any]:
    """Return the rows of a role's split."""
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
