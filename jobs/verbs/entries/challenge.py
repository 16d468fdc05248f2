"""`twillight challenge`: a secret seed with a public hash, the recipe that it draws, and the board of entries.

A round is the recipe `challenge` with the seeds of the round in place of its own. So the population and the queries are
those of the code that all recipes share, and whoever has the seed generates the same bytes. A text that is public only
after the hash, and that nobody controls, enters too: nobody can draw seeds until one suits. The list of versions is no
such text, because the organiser writes it and knows the seed.
"""

import hashlib
import os
import secrets
import tomllib
from pathlib import Path
from typing import Annotated, Final

import tomli_w
from cyclopts import Parameter

from jobs.recipe.entry import FORM, EntryForm, is_plain
from jobs.recipe.shipped import RECIPES
from jobs.terminal import print_lines
from jobs.verbs.parameters import Local
from pipeline.atomic import atomic_write, disk_errors
from pipeline.fingerprint import stream_seed
from weaves.errors import BadInput
from weaves.reading import read_text
from weaves.validation import read_toml, validated

_WHERE: Final = "challenge"
_SEED: Final = "seed"
_MOST: Final = 1024  # bytes of a file with a seed
_DIGITS: Final = 8  # of the hash, in the name of a round
_MOST_LETTERS: Final = 80  # of a text: `about` of a recipe has 200

_HEAD: Final = """\
# Entries

Written by `twillight challenge board` from the folders of {count} entries, which answer the questions `{questions}`. \
Errors were measured by benchmark version {version}, on the data set `{dataset}`; whoever has the recipe measures them \
again with `twillight bench RECIPE --answers FOLDER`. Costs are stated by the entrants. Entries are compared within a \
class only: the most multiply-adds of a query, and bytes of a fabric."""

Folder = Annotated[Local, Parameter(help="Folder to write to.")]


def new(*, to: Folder) -> None:
    """Write a new seed that only its owner can read, and print its hash; BadInput if there is one already."""
    path, seed = to / _SEED, secrets.token_hex(32)
    with disk_errors(path):
        to.mkdir(parents=True, exist_ok=True)
        try:
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        except FileExistsError as error:
            raise BadInput(_WHERE, "--to", str(to), "holds a seed, which is never replaced; name another") from error
        try:
            with open(handle, "w") as file:  # noqa: PTH123, there is a handle only
                file.write(seed)
        except OSError:
            path.unlink()  # a part of a seed would be kept as one
            raise
    print_lines(f"{path}: keep it secret until all answers are in; publish its SHA-256 now:", _sha256(seed))


def reveal(
    seed: Annotated[str, Parameter(help="The seed, or the file that holds it.")],
    *,
    to: Folder,
    public: Annotated[str, Parameter(help="Text that nobody knew when the hash was published; at most 80 letters.")],
    commitment: Annotated[str | None, Parameter(help="SHA-256 that was published; another seed is refused.")] = None,
) -> None:
    """Write the recipe of a round; BadInput if the seed or the text cannot be used, or the commitment is of another."""
    text = _read(seed)
    sha256 = _sha256(text)
    if commitment is not None and commitment.strip().lower() != sha256:
        raise BadInput(_WHERE, "--commitment", commitment, f"the seed has the SHA-256 {sha256}")
    if not public or len(public) > _MOST_LETTERS or not public.isprintable():
        raise BadInput(_WHERE, "--public", public, f"a line of at most {_MOST_LETTERS} letters is needed")
    content = tomllib.loads((RECIPES / f"{_WHERE}.toml").read_text(encoding="utf-8"))
    content["name"] = f"{_WHERE}-{sha256[:_DIGITS]}"
    content["about"] = f"Round of the seed with the SHA-256 {sha256} and of the text {public}"
    for table, purpose in ((content["dataset"], "queries"), (content["dataset"]["unseen_population"], "cloths")):
        table["seed"] = stream_seed(f"{_WHERE} {purpose}", [text, public]) >> 1  # TOML has signed integers
    path, recipe = to / f"{content['name']}.toml", tomli_w.dumps(content).encode()
    with disk_errors(path):
        other = path.exists() and path.read_bytes() != recipe
    if other:
        allowed = f"{path} is another round, or of another version: take another folder for --to"
        raise BadInput(_WHERE, "--public", public, allowed)
    atomic_write(path, recipe)
    print_lines(f"{path}: `twillight questions {path} --to FOLDER` writes its questions")


def board(
    entries: Annotated[list[Local], Parameter(help="Folders that `bench --answers` left in out/entries.")],
    *,
    to: Annotated[Local, Parameter(help="Markdown file to write.")],
) -> None:
    """Write the tables of entries; BadInput if one was not measured, two have one name, or their rows differ."""
    from reports.catalogue import columns_of
    from reports.record import Record, read_records
    from reports.tables.page_tables import ENTRY_CLASSES, entry_class, page_frames, result_tables

    by_class: dict[str, list[Record]] = {entry_class(size): [] for size in (*ENTRY_CLASSES, ENTRY_CLASSES[-1] + 1)}
    facts: dict[str, object] = {}
    names = set[str]()
    for folder in entries:
        form = validated(EntryForm, read_toml(folder / FORM), str(folder / FORM))
        records = read_records([folder / "records.json"])
        whole = {record.method for record in records} == {form.name}
        if not whole or not {record.metric for record in records} >= {*columns_of("entries")}:
            raise BadInput(str(folder / "records.json"), "", "holds other Records", f"those of {form.name} are needed")
        costs = [record for record in records if record.metric in columns_of("entries")]
        stated = [(record.metric, record.value, record.note) for record in costs]
        if sorted(stated) != sorted(form.costs):
            raise BadInput(str(folder / "records.json"), "", "states other costs", f"those of {FORM} are needed")
        if not all(is_plain(record.fabric + record.setting) for record in records):
            raise BadInput(str(folder / "records.json"), "", "has names with signs of Markdown", "letters are needed")
        if form.name in names:
            raise BadInput(str(folder), "name", form.name, "is the name of another entry")
        names.add(form.name)
        about = records[0].provenance
        for key, value in (("questions", form.questions), ("version", about.version), ("dataset", about.dataset)):
            if (known := facts.setdefault(key, value)) != value:
                raise BadInput(str(folder), key, value, f"that of the entries before is {known}")
        by_class[entry_class(max(form.bytes_stored, form.multiply_adds))] += records
    parts = [_HEAD.format(count=len(entries), **facts)]
    for name, records in by_class.items():
        tables = result_tables(records, page_frames(records), {}) if records else {}
        shown = [table for section in ("entries", "error") for table in tables.get(section, ())]
        parts += [f"## {name}"] if shown else []
        parts += [f"### {table.title}\n\n{table.markdown()}" for table in shown]
    atomic_write(to, ("\n\n".join(parts) + "\n").encode())
    print_lines(f"{to}: entries: {len(entries)}")


def _read(seed: str) -> str:
    """Return the seed that is given as it is, or in a file."""
    path = Path(seed)
    if "\0" not in seed and len(seed) < _MOST and path.exists():
        seed = read_text(path, _MOST, "a file with a seed").strip()
    if len(seed) != 64 or set(seed) - set("0123456789abcdef"):
        raise BadInput(_WHERE, "SEED", seed, "64 hexadecimal digits are needed, or the file that `challenge new` wrote")
    return seed


def _sha256(seed: str) -> str:
    """Return the hash of a seed, in hexadecimal; `printf SEED | sha256sum` gives the same."""
    return hashlib.sha256(seed.encode()).hexdigest()
