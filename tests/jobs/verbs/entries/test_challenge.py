import errno
import hashlib
import re
import stat
import tomllib
from unittest.mock import Mock

from jobs.recipe.load import load_recipe
from jobs.verbs.entries import challenge


def test_a_round_is_drawn_from_its_seed_and_only_from_it(call, tmp_path):
    code, said, _ = call("challenge", "new", "--to", tmp_path)
    file = tmp_path / "seed"
    seed, (sha256,) = file.read_text(), re.findall(r"\b[0-9a-f]{64}\b", said)
    assert code == 0 and stat.S_IMODE(file.stat().st_mode) == 0o600
    assert hashlib.sha256(seed.encode()).hexdigest() == sha256 and seed not in said
    rounds = {"a": (seed, "x"), "b": (file, "x"), "c": ("0" * 64, "x"), "d": (seed, "y" * 80)}
    for folder, (given, public) in rounds.items():
        checked = ("--commitment", sha256) if folder != "c" else ()
        reveal = ("challenge", "reveal", given, "--public", public, "--to", tmp_path / folder, *checked)
        assert call(*reveal)[0] == 0
    a, b, c, d = (next((tmp_path / folder).iterdir()) for folder in rounds)
    assert a.read_bytes() == b.read_bytes() and a.name == b.name == d.name == f"challenge-{sha256[:8]}.toml" != c.name
    recipes = [load_recipe(path) for path in ("challenge", a, c, d)]
    names = [fabric.optics() for recipe in recipes for fabric in recipe.unseen_population]
    assert len(names) == 4 * 22 and all(names.count(optics) == 1 for optics in names)
    assert len({recipe.dataset.seed for recipe in recipes}) == 4
    same = [tomllib.loads(path.read_text())["dataset"] | {"seed": 0, "unseen_population": 0} for path in (a, c, d)]
    assert same[0] == same[1] == same[2]


def test_seeds_are_never_replaced_nor_written_in_part_and_another_one_is_refused(call, refused, tmp_path, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(challenge, "open", Mock(side_effect=OSError(errno.ENOSPC, "No space left")), raising=False)
        code, _, told = call("challenge", "new", "--to", tmp_path)
    assert code == 1 and "No space left" in told and not (tmp_path / "seed").exists()
    call("challenge", "new", "--to", tmp_path)
    before = (tmp_path / "seed").read_text()
    assert "holds a seed, which is never replaced" in refused("challenge", "new", "--to", tmp_path)
    assert (tmp_path / "seed").read_text() == before
    reveal = ("challenge", "reveal", "--to", tmp_path / "round", "--public", "x")
    assert "--public" in refused(*reveal[:-1], "x" * 81, tmp_path / "seed")
    assert "the seed has the SHA-256" in refused(*reveal, tmp_path / "seed", "--commitment", "0" * 64)
    assert not (tmp_path / "round").exists()
    assert call(*reveal, tmp_path / "seed")[0] == 0 == call(*reveal, tmp_path / "seed")[0]
    assert "is another round" in refused(*reveal[:-1], "y", tmp_path / "seed")
