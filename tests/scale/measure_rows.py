"""Measure generating, checking and reading for training at 10^5, 10^6 and 10^7 rows.

Command: ``PYTHONPATH=. python tests/scale/measure_rows.py [--rows 100000 --rows 1000000] [--workers 2]``

The rows are training rows of one plain fabric, answered by 64 points each, which costs a hundredth of what real rows
cost, in shards of the default size. Each step is a process of its own: `twillight generate`, `twillight check`, and the
reading of a training: its first batch and 1,000 more. Printed for each: seconds of the clock and (in brackets) of
processor time, the peak memory of the largest process (resident set, pages of mapped files included), and the most
files that one process had open; for the reading, the same two times of the first batch, imports left out.

With ``--links 100`` only the reading is measured, of so many shards of 10^6 rows that are links to one file; with
``--dataset FOLDER`` that of a data set.
"""

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cyclopts
import psutil

ROOT = Path(__file__).parents[2]
START = "import sys; from jobs.entry import main; sys.exit(main())"
RECIPE = """
name = "rows"
[dataset]
seen = ["polyester_lining"]
rows = {{ train = {rows}, validation = 64, test = 64 }}
truth = {{ estimator = "owen", relative_error = 0.5, min_count = 64, max_count = 64 }}
[[models]]
model = "neumip"
"""
SECONDS_BETWEEN_LOOKS = 0.2


FABRICS = ["denim", "satin_8", "gauze", "organza", "herringbone", "silk_charmeuse", "basket", "houndstooth"]


def write_links(folder: Path, shards: int, rows: int = 10**6) -> None:
    """Write a data set whose shards are links to one of random numbers."""
    import numpy as np

    from pipeline.shards.manifest import Manifest, ShardEntry
    from pipeline.shards.queries import QueryOptions, draw_queries
    from pipeline.shards.store import columns_of, write_columns
    from pipeline.truth.query import Answers
    from weaves.fabric import load_fabric

    queries = draw_queries(QueryOptions(), load_fabric(FABRICS[0]).weave.repeat, 0, 0, rows)
    mean = np.random.default_rng(0).random((rows, 4), np.float32)
    columns = columns_of(queries, Answers.opaque(mean, mean, np.ones(rows, np.int32)))
    write_columns(folder / "0.parquet", "components", FABRICS[0], columns, {})
    entries = []
    for index in range(shards):
        fabric, start = FABRICS[index % len(FABRICS)], index // len(FABRICS) * rows
        facts = {"file": f"{index}.parquet", "split": "train", "rows": rows, "sha256": "0" * 64}
        entries.append(ShardEntry(fabric=fabric, start=start, **facts))
        if index:
            os.link(folder / "0.parquet", folder / entries[-1].file)
    fabrics = {name: load_fabric(name) for name in FABRICS}
    Manifest(name="links", fingerprint="0", roles={"seen": FABRICS}, fabrics=fabrics, about={}, shards=entries).save(
        folder
    )


def read(folder: Path) -> None:
    """Read the first batch of a training and a thousand more, of 8,192 rows; print seconds and memory."""
    import torch

    from pipeline.shards.manifest import Manifest
    from pipeline.training.dataset import Order, TrainingRows

    fabrics = list(Manifest.load(folder).fabrics)  # imports what it needs
    for first, last in ((0, 1), (1, 1001)):
        wall, cpu = time.perf_counter(), time.process_time()
        if first == 0:
            rows = TrainingRows(Manifest.load(folder), folder, fabrics, torch.device("cpu"))
            rows.spread(2**16)
            order = Order(rows.windows, 8192, len(fabrics), 0)
        for step in range(first, last):
            rows.batch(*order.step(step))
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{last - first} batches: {wall:.1f} ({cpu:.1f}) s, {memory:.0f} MiB", flush=True)


def watched(command: list[str]) -> tuple[list[str], list[str]]:
    """Run a command; return cells of the table, and the lines that it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start, memory, files = time.perf_counter(), 0, 0
    with tempfile.TemporaryFile("w+") as out:
        process = psutil.Popen(command, cwd=ROOT, stdout=out, stderr=subprocess.STDOUT)
        while process.poll() is None:
            try:
                for one in (process, *process.children(recursive=True)):
                    memory, files = max(memory, one.memory_info().rss), max(files, one.num_fds())
            except psutil.Error:
                pass  # it has just ended
            time.sleep(SECONDS_BETWEEN_LOOKS)
        out.seek(0)
        said = out.read()
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if process.returncode not in (0, 1):  # check: nothing was trained
        sys.exit(said)
    return [f"{wall:.0f} ({cpu:.0f})", f"{memory / 2**20:.0f} MiB", str(files)], said.strip().splitlines()


def main(
    rows: tuple[int, ...] = (10**5, 10**6, 10**7), workers: int = 2, dataset: Path | None = None, links: int = 0
) -> None:
    """Measure each number of rows and print a table; with a data set, only read it."""
    if dataset:
        read(dataset)
        return
    if links:
        with tempfile.TemporaryDirectory() as name:
            write_links(Path(name), links)
            subprocess.run([sys.executable, __file__, "--dataset", name], check=True)
        return
    print("| rows | step | seconds | memory | files | first batch |\n|---|---|---|---|---|---|")
    for count in rows:
        with tempfile.TemporaryDirectory() as name:
            recipe, out = Path(name) / "rows.toml", Path(name) / "out"
            recipe.write_text(RECIPE.format(rows=count))
            for step in ("generate", "check", "read"):
                command = [sys.executable, "-c", START, step, str(recipe), "--out", str(out)]
                if step == "generate":
                    command += ["--workers", str(workers)]
                if step == "read":
                    command = [sys.executable, __file__, "--dataset", str(next(out.glob("datasets/*")))]
                cells, said = watched(command)
                first = said[0].partition(": ")[2].partition(" s,")[0] if step == "read" else ""
                print(f"| {count:,} | {step} | {' | '.join(cells)} | {first} |", flush=True)


if __name__ == "__main__":
    cyclopts.run(main)
