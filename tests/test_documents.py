"""What the documents say of the tree: lengths, numbers, paths, commands, examples."""

import importlib.util
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import yaml

from jobs.cli import app
from jobs.recipe.shipped import recipe_names
from pipeline.models.catalogue import CLASSES
from pipeline.scenes.shipped import SHIPPED
from pipeline.shards.schema import SCHEMAS
from pipeline.truth.estimator import ESTIMATORS
from reports.tables.documents import split_at_block
from weaves.fabric import PRESETS, load_fabric

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ROOMS = ("weaves", "pipeline", "reports", "jobs")
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
DOCUMENTS += sorted((ROOT / "docs").glob("*.md"))
DOCUMENTS += [path for room in ROOMS for path in sorted((ROOT / room).rglob("README.md"))]

LONGEST_README = 7500
"""Characters: one screen and a half."""

NAMES_WITH_DIGITS = ("Python 3.11", "Mitsuba 3")

VERBS = {name for name in app.resolved_commands() if not name.startswith("-")}

OF_RECIPES = {"plan", "generate", "train", "bench", "report", "run", "status", "results", "savings"}
"""Verbs whose first argument is a recipe."""


def text_of(path):
    return path.read_text(encoding="utf-8")


def code_of(path):
    """Return every span of code, and every line of a code block, of a document."""
    text = text_of(path)
    fenced = re.findall(r"^```\w*\n(.*?)^```$", text, re.M | re.S)
    rest = re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)
    indented = re.findall(r"^    (.+)$", rest, re.M)
    lines = [line for code in fenced for line in code.splitlines()]
    return [*re.findall(r"`([^`\n]+)`", rest), *indented, *lines]


def commands_of(path, program):
    """Return the arguments of every call of a program that a document shows."""
    calls = [code.removeprefix("$ ") for code in code_of(path)]
    return [shlex.split(call, comments=True)[1:] for call in calls if call.startswith(f"{program} ")]


def test_the_readme_is_one_screen_and_a_half_and_no_number_of_it_is_typed_by_hand():
    text = text_of(ROOT / "README.md")
    before, block, after = split_at_block(text, "README.md")
    assert len(text) <= LONGEST_README and "Recipe `quick`" in block
    least = PROJECT["requires-python"].removeprefix(">=")
    assert f"Python {least} or newer" in text
    prose = before + after
    for pattern in (r"<!--.*?-->", r"^    .+$", r"`[^`\n]+`", r"\]\([^)]*\)"):
        prose = re.sub(pattern, "", prose, flags=re.M)
    for name in NAMES_WITH_DIGITS:
        prose = prose.replace(name, "")
    assert not re.findall(r".*\d.*", prose)


def check_links_and_paths_exist(path):
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)\s]+)\)", text_of(path))]
    wrong = [link for link in links if "://" not in link and not (path.parent / link).exists()]
    assert not wrong, f"links that lead nowhere: {wrong}"
    examples = re.findall(r"^`(\S+)`:$", text_of(path), re.M)  # followed by tests/test_contributing.py
    paths = [
        code
        for code in code_of(path)
        if code not in examples and re.fullmatch(rf"({'|'.join(ROOMS)}|tests)/[\w./-]+", code)
    ]
    wrong = [name for name in paths if not (ROOT / name).exists()]
    assert not wrong, f"files that do not exist: {wrong}"


def check_modules_exist(path):
    named = {code for code in code_of(path) if re.fullmatch(rf"({'|'.join(ROOMS)})(\.\w+)+", code)}
    files = {name for name in named if name.rpartition(".")[2] in ("py", "toml", "md")}
    wrong = [name for name in sorted(named - files) if not importlib.util.find_spec(name)]
    assert not wrong, f"modules that do not exist: {wrong}"


def check_commands_are_understood(path):
    for tokens in commands_of(path, "twillight"):
        if len(tokens) == 1:
            assert tokens[0] in {*VERBS, "--version", "--install-completion"}, f"{tokens}: no such verb"
            continue
        app.parse_args(tokens, exit_on_error=False, print_error=False)
        if tokens[0] in OF_RECIPES and not tokens[1].isupper() and not tokens[1].endswith(".toml"):
            assert tokens[1] in recipe_names(), f"{tokens}: no such recipe"


def check_targets_of_make_exist(path):
    (phony,) = re.findall(r"^\.PHONY: (.+)$", text_of(ROOT / "Makefile"), re.M)
    asked = {tokens[0] for tokens in commands_of(path, "make")}
    assert asked - {"VERB"} <= set(phony.split())


CHECKS = (check_links_and_paths_exist, check_modules_exist, check_commands_are_understood, check_targets_of_make_exist)


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_what_a_document_names_exists(path):
    for check in CHECKS:
        check(path)


def test_every_verb_and_every_room_of_work_is_in_the_readme():
    assert {tokens[0] for tokens in commands_of(ROOT / "README.md", "twillight")} == VERBS
    rooms = ["weaves", *(f"pipeline/{name}" for name in ("truth", "shards", "models", "scenes")), "jobs", "reports"]
    readme = text_of(ROOT / "README.md")
    assert [room for room in rooms if f"({room}/README.md)" not in readme] == []


def test_denim_is_the_example_of_weaves():
    text = text_of(ROOT / "weaves" / "README.md")
    drawn = [line.removeprefix("    ").rstrip() for line in re.findall(r"^    [·█].*$", text, re.M)]
    assert drawn == [line.rstrip() for line in load_fabric("denim").weave.text().splitlines()]
    (shown,) = re.findall(r"^```toml\n(.*?)^```$", text, re.M | re.S)
    preset = tomllib.loads(text_of(PRESETS / "denim.toml"))
    assert tomllib.loads(shown) == {key: value for key, value in preset.items() if key != "source"}


def test_models_estimators_kinds_of_rows_scenes_and_recipes_are_listed():
    text = text_of(ROOT / "pipeline" / "models" / "README.md")
    known, of_rays = {}, {}
    for names, *cells, rays in re.findall(r"^\| ((?:`\w+`(?:, )?)+) \|" + 4 * r" (.+?) \|" + "$", text, re.M):
        kinds = {kind for kind, cell in zip(("behind", "stretch", "curvature"), cells, strict=True) if cell == "yes"}
        known |= dict.fromkeys(re.findall(r"`(\w+)`", names), kinds)
        of_rays |= dict.fromkeys(re.findall(r"`(\w+)`", names), (rays.startswith("learnt"), rays.startswith("yes")))
    fields = {name: options.model_fields for name, options in CLASSES.items()}
    assert of_rays == {name: (CLASSES[name].any_physics, "parallax" in fields[name]) for name in CLASSES}
    assert known == {name: set(options().kinds) for name, options in CLASSES.items()}
    assert set(listed("pipeline/truth", "[^|]+")) == set(ESTIMATORS) and listed("pipeline/shards") == list(SCHEMAS)
    assert set(listed("pipeline/scenes")) == set(SHIPPED)
    extra = re.findall(r"`(trade_\w+)`", text_of(ROOT / "jobs" / "README.md"))
    assert set(recipe_names()) <= {*listed("jobs", "[^|]+"), *extra}


def listed(folder, cell=r"\w+"):
    """Return the names in the first cells of the tables of a room's README; of such cells alone."""
    cells = re.findall(rf"^\| (`{cell}`) \|", text_of(ROOT / folder / "README.md"), re.M)
    return [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]


def test_changelog_and_citations_have_the_package_version():
    assert re.search(r"^## (\S+)", text_of(ROOT / "CHANGELOG.md"), re.M)[1] == PROJECT["version"]
    cited = yaml.safe_load(text_of(ROOT / "CITATION.cff"))
    entry = text_of(ROOT / "BIBLIOGRAPHY.bib").partition("@software{Twillight,")[2].partition("\n}")[0]
    fields = {name: value.strip("{}").replace("}", "") for name, value in re.findall(r"(\w+) += \{(.*)\}", entry)}
    assert (cited["version"], cited["license"]) == (PROJECT["version"], PROJECT["license"])
    assert [cited["authors"][0]["name"], cited["title"], cited["version"]] == [
        fields[name] for name in ("author", "title", "version")
    ]


def test_reference_keys_that_docstrings_cite_are_in_the_bibliography():
    listed = set(re.findall(r"@\w+\{(\w+),", text_of(ROOT / "BIBLIOGRAPHY.bib")))
    sources = [path for room in ROOMS for path in (ROOT / room).rglob("*.py")]
    cited = {key for path in sources for key in re.findall(r"\[([A-Z][a-z]+\d{4}[A-Za-z]*)\]", text_of(path))}
    assert cited and cited <= listed
