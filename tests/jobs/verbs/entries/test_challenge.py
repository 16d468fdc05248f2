import hashlib
import re
import stat
import tomllib

from jobs.recipe.load import load_recipe


def test_a_round_is_drawn_from_its_seed_and_only_from_it(call, tmp_path):
    code, said, _ = call("challenge", "new", "--to", tmp_path)
    file = tmp_path / "seed"
    seed, (sha256,) = file.read_text(), re.findall(r"\b[0-9a-f]{64}\b", said)
    assert code == 0 and stat.S_IMODE(file.stat().st_mode) == 0o600
    assert hashlib.sha256(seed.encode()).hexdigest() == sha256 and seed not in said
    for given, folder in ((seed, "a"), (file, "b"), ("0" * 64, "c")):
        checked = ("--commitment", sha256) if given != "0" * 64 else ()
        assert call("challenge", "reveal", given, "--to", tmp_path / folder, *checked)[0] == 0
    (a,), (b,), (c,) = ((tmp_path / folder).iterdir() for folder in "abc")
    assert a.read_bytes() == b.read_bytes() and a.name == b.name == f"challenge-{sha256[:8]}.toml" != c.name
    template, one, other = (load_recipe(path) for path in ("challenge", a, c))
    names = [fabric.optics() for recipe in (template, one, other) for fabric in recipe.unseen_population]
    assert len(one.unseen_population) == len(template.unseen_population) == 22
    assert all(names.count(optics) == 1 for optics in names)
    assert len({recipe.dataset.seed for recipe in (template, one, other)}) == 3
    left = tomllib.loads(a.read_text())["dataset"] | {"seed": 0, "unseen_population": 0}
    assert left == tomllib.loads(c.read_text())["dataset"] | {"seed": 0, "unseen_population": 0}


def test_seeds_are_never_replaced_and_another_one_is_refused(call, refused, tmp_path):
    call("challenge", "new", "--to", tmp_path)
    before = (tmp_path / "seed").read_text()
    assert "holds a seed, which is never replaced" in refused("challenge", "new", "--to", tmp_path)
    assert (tmp_path / "seed").read_text() == before
    reveal = ("challenge", "reveal", "--to", tmp_path / "round")
    assert "the seed has the SHA-256" in refused(*reveal, tmp_path / "seed", "--commitment", "0" * 64)
    for seed in ("12", "g" * 64, tmp_path, "x" * 5000):
        refused(*reveal, seed)
    assert not (tmp_path / "round").exists()
