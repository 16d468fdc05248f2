"""Files of a published data set: which shards are joined in which file; and what several files share, as a citation.

A file holds whole fabrics of one role and one split. Research repositories take about a hundred files, so fabrics share
a file if there are many.
"""

import re
from dataclasses import dataclass
from datetime import date
from typing import Annotated, Final, NamedTuple

from cyclopts import Parameter

from pipeline.shards.manifest import Manifest, Role, ShardEntry
from weaves.errors import BadInput

MOST_FILES: Final = 90  # most Parquet files, if each role and split has one at least
ROLES: Final[tuple[Role, ...]] = ("seen", "population", "unseen", "unseen_population")
POPULATIONS: Final[tuple[Role, ...]] = ("population", "unseen_population")  # roles of random fabrics
_SPLITS: Final = ("train", "validation", "test")
_AUTHORS: Final = ("The Twillight authors",)
_FORMS: Final = {
    "title": (r"[^\s{}\\][^{}\\]{0,299}", "at most 300 letters are needed, without {, } and \\"),
    "author": (r"[^\s{}\\][^{}\\]{0,199}", '"Family, Given" or the name of a group is needed'),
    "date": (r"\d{4}-\d\d-\d\d", "a day such as 2026-11-26 is needed"),
    "url": (r"https?://[^\s{}\\]{1,500}", "an address that begins with https:// is needed"),
    "doi": (r"10\.\d{4,9}/[^\s{}\\]{1,200}", "a DOI such as 10.5281/zenodo.7 is needed, without https://doi.org/"),
}


class PublishedPart(NamedTuple):
    """A file of rows of one role and one split."""

    file: str
    role: Role
    split: str
    fabrics: tuple[str, ...]  # names of its fabrics, in the order of their rows
    shards: tuple[ShardEntry, ...]  # its shards, in the order of their rows

    @property
    def rows(self) -> int:
        """Number of rows."""
        return sum(shard.rows for shard in self.shards)


def own_shards(manifest: Manifest) -> list[ShardEntry]:
    """Return the shards that every model may read; extra rows of single models are no part of the data set."""
    return [shard for shard in manifest.shards if shard.kind == "components"]


def parts_of(manifest: Manifest) -> list[PublishedPart]:
    """Return the files of a data set, by role, split and fabric."""
    shards: dict[tuple[str, str], list[ShardEntry]] = {}
    for shard in sorted(own_shards(manifest), key=lambda shard: shard.start):
        shards.setdefault((shard.fabric, shard.split), []).append(shard)
    parts = []
    for role in ROLES:
        for split in _SPLITS:
            names = [name for name in manifest.names(role) if (name, split) in shards]
            files = min(len(names), max(1, MOST_FILES * len(names) // len(shards)))
            for number in range(files):
                group = names[len(names) * number // files : len(names) * (number + 1) // files]
                rows = tuple(shard for name in group for shard in shards[name, split])
                file = f"{stem(role, split)}-{number:02}.parquet"
                parts.append(PublishedPart(file, role, split, tuple(group), rows))
    return parts


def stem(role: str, split: str) -> str:
    """Return the path of a role's and split's files, without their numbers; it says what they must not be used for.

    Rows of unseen cloth that are not for tests are for models of that cloth alone.
    """
    split = "test_only" if split == "test" else f"one_cloth_{split}" if role.startswith("unseen") else split
    return f"data/{role}/{split}"


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


def _is_day(text: str) -> bool:
    try:
        return bool(date.fromisoformat(text))
    except ValueError:
        return False


class About(NamedTuple):
    """Facts of a published data set."""

    manifest: Manifest
    parts: list[PublishedPart]
    licence: str  # SPDX identifier
    citation: Citation
    truth_version: int  # version of the ground truth that answered the rows; 0 if the shards do not name it

    @property
    def id(self) -> str:
        """Name for programs."""
        return f"twillight-{self.manifest.name}"

    @property
    def summary(self) -> str:
        """Description of the data set in two sentences."""
        return (
            f"{self.rows:,} queries of the patch BSDF of {len(self.manifest.fabrics)} woven fabrics: a footprint, a "
            "direction to the light and one to the viewer, and the light that the cloth returns, computed from its "
            "weave and its yarns. Every answer has a standard error and a bound of its error."
        )

    @property
    def rows(self) -> int:
        """Number of rows."""
        return sum(part.rows for part in self.parts)

    @property
    def version(self) -> str:
        """Version: that of the columns, that of the ground truth, and 0."""
        return f"{self.manifest.schema_version}.{self.truth_version}.0"

    @property
    def sets(self) -> list[tuple[Role, str]]:
        """Roles and splits that have rows."""
        return list(dict.fromkeys((part.role, part.split) for part in self.parts))
