"""How a published data set is cited: in `CITATION.cff`, as BibTeX, and in one line."""

from __future__ import annotations

import re
from dataclasses import dataclass
from datetime import date
from typing import Annotated, Any, Final

import yaml
from cyclopts import Parameter

from weaves.errors import BadInput

_AUTHORS: Final = ("The Twillight authors",)
_FORMS: Final = {
    "title": (r"[^\s{}\\][^{}\\]{0,299}", "at most 300 letters are needed, without {, } and \\"),
    "author": (r"[^\s{}\\][^{}\\]{0,199}", '"Family, Given" or the name of a group is needed'),
    "date": (r"\d{4}-\d\d-\d\d", "a day such as 2026-11-26 is needed"),
    "url": (r"https?://[^\s{}\\]{1,500}", "an address that begins with https:// is needed"),
    "doi": (r"10\.\d{4,9}/[^\s{}\\]{1,200}", "a DOI such as 10.5281/zenodo.7 is needed, without https://doi.org/"),
}


@dataclass(frozen=True)
class Citation:
    """A reference to a data set, also on the command line; empty: not known, or the default."""

    title: Annotated[str, Parameter(help="Title; default: what it holds, with the name of its recipe.")] = ""
    author: Annotated[tuple[str, ...], Parameter(help='Author, "Family, Given" or a group; several.')] = _AUTHORS
    date: Annotated[str, Parameter(help="Day of publication, such as 2026-11-26.")] = ""
    url: Annotated[str, Parameter(help="Address where the data set will be.")] = ""
    doi: Annotated[str, Parameter(help="DOI reserved for it, such as 10.5281/zenodo.7.")] = ""

    def refuse_wrong(self) -> None:
        """Raise BadInput if a value has not its form."""
        given = [("title", self.title), ("date", self.date), ("url", self.url), ("doi", self.doi)]
        for flag, value in (*((name, value) for name, value in given if value), *(("author", a) for a in self.author)):
            form, allowed = _FORMS[flag]
            if not (value.isprintable() and re.fullmatch(form, value) and (flag != "date" or _is_day(value))):
                raise BadInput("publish", f"--{flag}", value, allowed)

    @property
    def persons(self) -> list[tuple[str, str]]:
        """Family and given name of each author; the given name of a group is empty."""
        return [(family, given) for family, _, given in (name.partition(", ") for name in self.author)]

    def line(self, version: str) -> str:
        """Return the reference as one line."""
        names = ", ".join(f"{given} {family}".strip() for family, given in self.persons)
        where = f"https://doi.org/{self.doi}" if self.doi else self.url
        year = f" ({self.date[:4]})" if self.date else ""
        return ". ".join(filter(None, (f"{names}{year}: {self.title}", f"Version {version}", where)))

    def bibtex(self, key: str, version: str) -> str:
        """Return the entry for BibTeX."""
        authors = " and ".join(f"{family}, {given}" if given else f"{{{family}}}" for family, given in self.persons)
        words = {"title": f"{{{self.title}}}", "author": authors}
        fields = {name: re.sub(r"([&%#_$])", r"\\\1", value) for name, value in words.items()}
        fields |= {"year": self.date[:4], "version": version, "doi": self.doi, "url": self.url}
        lines = [f"  {name} = {{{value}}}," for name, value in fields.items() if value]
        return "\n".join([f"@misc{{{key},", *lines, "}"])

    def cff(self, **facts: Any) -> str:
        """Return the text of ``CITATION.cff``, in the Citation File Format 1.2, with more facts of the data set."""
        authors = [{"family-names": f, "given-names": g} if g else {"name": f} for f, g in self.persons]
        known = {"date-released": self.date, "url": self.url, "doi": self.doi}
        content = {
            "cff-version": "1.2.0",
            "message": "If you use this data set, please cite it as below.",
            "type": "dataset",
            "title": self.title,
            "authors": authors,
            **{name: value for name, value in known.items() if value},
            **facts,
        }
        return str(yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=120))


def _is_day(text: str) -> bool:
    try:
        return bool(date.fromisoformat(text))
    except ValueError:
        return False
