"""The smallest recipe of every stage; and shipped ones at a hundredth of their rows, steps and pixels.

These keep their fabrics, models and estimators. Of a population the first 32 members are kept, of an unseen one the
first 4, of several trainings two.
"""

import tomllib

import tomli_w

from jobs.recipe.recipe import Rows
from jobs.recipe.shipped import RECIPES
from pipeline.models.catalogue import CLASSES
from pipeline.training.options import TrainingOptions
from reports.options import BenchOptions

SCALE = 100
MOST_MEMBERS = 32
MOST_UNSEEN = 4
MOST_SEEDS = 2

SMALLEST = """
[dataset]
seen = ["polyester_lining"]
shard_rows = 256
rows = { train = 256, validation = 64, test = 128 }
truth = { estimator = "owen", relative_error = 0.2, min_count = 64, max_count = 64 }

[[models]]
model = "neumip"
texels_per_yarn = 2
training = { steps = 4, batch = 64, checkpoint_every = 2, device = "cpu" }

[[models]]
model = "point_sampled"
counts = [2]

[bench]
sphere_size = [16, 16]
plane_size = [16, 16]
picture_counts = [2]
frames = 3
frame_size = [16, 16]
rows = 64
timing_rows = 64
timing_repeats = 20
threads = [1]
latents = false
truth = { estimator = "owen", relative_error = 0.2, min_count = 64, max_count = 128 }
"""


def write_smallest(folder, name, dataset=None, model=None):
    """Write the smallest recipe with a name, and other values of its tables; return its path."""
    content = {"name": name} | tomllib.loads(SMALLEST)
    for table, changes in ((content["dataset"], dataset), (content["models"][0], model)):
        for key, value in (changes or {}).items():
            table[key] = table.get(key, {}) | value if isinstance(value, dict) else value
    return write_toml(folder, content)


def write_toml(folder, content):
    """Write a recipe into a folder, under its name; return its path."""
    path = folder / f"{content['name']}.toml"
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path


def write_small(name, folder):
    """Write the recipe and those that it names into a folder; return its path."""
    content = tomllib.loads((RECIPES / f"{name}.toml").read_text(encoding="utf-8"))
    dataset = content["dataset"]
    least = {"train": 128, "population": 64, "validation": 64, "test": 128}
    dataset["rows"] = _scaled(Rows(**dataset["rows"]).model_dump(), least)
    if "population" in dataset:
        dataset["population"]["count"] = min(dataset["population"]["count"], MOST_MEMBERS)
    if "unseen_population" in dataset:
        dataset["unseen_population"]["count"] = min(dataset["unseen_population"]["count"], MOST_UNSEEN)
    dataset["shard_rows"] = 4096  # each shard is a task
    content["models"] = [_model(entry, folder) for entry in content.get("models", [])]
    content["bench"] = _bench(content.get("bench", {}))
    return write_toml(folder, content)


def _scaled(values, least):
    """Divide values by the scale where a least one is named; 0 stays 0."""
    return values | {key: max(values[key] // SCALE, low) if values[key] else 0 for key, low in least.items()}


def _model(entry, folder):
    if "recipe" in entry:
        return entry | {"recipe": write_small(entry["recipe"], folder).name}
    defaults = {name: field.default for name, field in CLASSES[entry["model"]].model_fields.items()}
    own = defaults | entry
    entry |= {"seeds": min(entry["seeds"], MOST_SEEDS)} if "seeds" in entry else {}
    least = {"silhouette_rows": 256, "measured_rows": 16, "samples": 2, "fewest_samples": 1}
    entry |= _scaled({key: own[key] for key in least if key in own}, {key: least[key] for key in least if key in own})
    if CLASSES[entry["model"]].learns:
        training = TrainingOptions(**entry.get("training", {})).model_dump()
        least = {"steps": 8, "batch": 64, "checkpoint_every": 4, "validation_rows": 128}
        # Smaller batches are noisier, and the warm-up is a step or two: at the whole rate a training may diverge.
        entry["training"] = _scaled(training, least) | {"learning_rate": 0.1 * training["learning_rate"]}
    return entry


def _bench(content):
    """Return measurements of a hundredth of the pixels, a tenth each way, and of the fewest frames and calls."""
    bench = BenchOptions(**content).model_dump(mode="json", exclude_none=True)
    for key in ("sphere_size", "plane_size", "frame_size"):
        bench[key] = [max(side // 10, 16) for side in bench[key]]
    bench |= _scaled({key: bench[key] for key in ("rows", "timing_rows")}, {"rows": 64, "timing_rows": 64})
    bench |= {"frames": 3, "timing_repeats": 20, "warm_up": 1}
    bench["edge"]["rows"] = max(bench["edge"]["rows"] // 10, 4)
    bench["scenes"] |= {"size": [24, 16], "frames": 3}
    bench["scenes"]["image"] |= {"block": 4, "resamples": 100}
    return bench
