"""A run of the smallest recipe, from a fabric to its page, task after task in this process: no cluster, no scene."""

from jobs.cli import main
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.ledger import Ledger
from reports.record import read_records

RECIPE = """
name = "serial"

[dataset]
seen = ["polyester_lining"]
shard_rows = 256

[dataset.rows]
train = 256
validation = 64
test = 128

[dataset.truth]
relative_error = 0.2
min_count = 64
max_count = 64

[[models]]
model = "neumip"
texels_per_yarn = 2
[models.training]
steps = 4
batch = 64
checkpoint_every = 4

[[models]]
model = "point_sampled"
counts = [1]

[bench]
sphere_size = [16, 16]
plane_size = [16, 16]
picture_counts = [1]
frames = 3
frame_size = [16, 16]
rows = 64
timing_rows = 64
latents = false
timing_repeats = 20
threads = [1]
truth = { relative_error = 0.2, min_count = 64, max_count = 64 }
"""


def test_a_recipe_becomes_a_page(tmp_path, here, capsys):
    (tmp_path / "serial.toml").write_text(RECIPE)
    command = ["run", str(tmp_path / "serial.toml"), "--out", str(tmp_path / "out")]
    assert main(command) == 0, capsys.readouterr().err
    tasks = plan(load_recipe(tmp_path / "serial.toml"))
    assert all(Ledger(tmp_path / "out").state(task) == "done" for task in tasks)
    page = tmp_path / "out" / "report" / "serial"
    records = read_records([page / "records.json"])
    assert {record.method for record in records} >= {"neumip", "point_sampled", "truth"}
    assert "<table" in (page / "index.html").read_text(encoding="utf-8")
    capsys.readouterr()
    assert main(command) == 0
    assert f"nothing to do: {len(tasks)} tasks done" in capsys.readouterr().out
