from jobs.plan.dataset import DataSet
from jobs.recipe.load import load_recipe
from jobs.run import manifest_file
from jobs.run.ledger import Ledger
from jobs.run.manifest_file import ManifestFile
from jobs.run.receipt import Product
from pipeline.shards.manifest import FILE, Manifest


def test_shards_are_listed_when_some_time_has_gone_by(files, tmp_path, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(manifest_file.time, "monotonic", lambda: now[0])
    dataset = DataSet(load_recipe(files.write()))
    manifest = ManifestFile(dataset, Ledger(tmp_path / "out"))
    file = manifest.folder / FILE

    def add(part):
        manifest.add(part, {part.products[0].rpartition("/")[2]: Product(sha256="ab" * 32, bytes=1)})

    def listed():
        return len(Manifest.load(manifest.folder).shards) if file.exists() else 0

    manifest.save()
    assert listed() == 0
    counts = []
    for part in dataset.shards[:6]:
        add(part)
        counts.append(listed())
        now[0] += 1.0
    assert counts == [1, 1, 3, 3, 5, 5]
    manifest.save()
    assert listed() == 6
    file.unlink()
    manifest.save()  # nothing has changed
    assert listed() == 0
    add(dataset.shards[6])
    manifest.save()
    assert listed() == 7
