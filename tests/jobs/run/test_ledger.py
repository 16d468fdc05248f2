import json
import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jobs.run.ledger import NEVER_MADE, Ledger, reasons
from jobs.run.receipt import Product, Receipt
from jobs.run.store import Store
from tests.jobs import fake_stages as fake
from weaves.errors import BadInput, WorkFailed

TASK = fake.task("x", folder="datasets/a-1")
PRODUCT = TASK.products[0]
NOTE = f"ledger/{TASK.id}.json"


@pytest.fixture
def done(tmp_path):
    fake.done(tmp_path, TASK)
    return Ledger(tmp_path)


@pytest.mark.parametrize(("path", "length"), [(PRODUCT, 6), (NOTE, 40), (NOTE, 0), (PRODUCT, None)])
def test_a_product_or_receipt_that_is_cut_or_gone_is_missing(done, path, length):
    assert done.state(TASK) == "done"
    file = done.out / path
    content = file.read_bytes()
    file.unlink()
    if length is not None:
        file.write_bytes(content[:length])
    assert done.state(TASK) == "missing"


def rewrite(ledger, change):
    """Write the receipt of TASK with other content, in the form of receipts that have no checksum."""
    path = ledger.out / NOTE
    content = json.loads(path.read_text()) | change
    del content["checksum"]
    path.write_text(json.dumps(content, indent=1) + "\n")


ODD = {
    "no files": {"files": {}},
    "a negative size": {"files": {"x.txt": {"sha256": "0" * 64, "bytes": -200}}},
    "a size in words": {"files": {"x.txt": {"sha256": "0" * 64, "bytes": "200"}}},
    "no hash": {"files": {"x.txt": {"sha256": "", "bytes": 200}}},
    "no number": {"seconds": float("nan")},
    "another task": {"task": "0" * 16},
    "a key too many": {"more": 1},
    **{f"an identity of {value}": {"identity": {"key": value}} for value in ([1], {"a": {}}, float("inf"))},
    "a path in place of a name": {"files": {"../x.txt": {"sha256": "0" * 64, "bytes": 200}}},
}


def test_a_receipt_of_before_checksums_is_read_and_a_failure_keeps_its_reason_until_success(done):
    rewrite(done, {"title": "rows 0–9", "identity": {"error": 1e-05}})
    assert b"\\u2013" in (done.out / NOTE).read_bytes() and done.state(TASK) == "done"
    (done.out / PRODUCT).unlink()
    done.fail(TASK, "the disk was full", "Traceback …")
    assert (done.state(TASK), done.reason(TASK)) == ("failed", "the disk was full")
    fake.done(done.out, TASK)
    assert (done.state(TASK), done.reason(TASK), done.seconds(TASK)) == ("done", "", 1.0)


def test_an_odd_receipt_and_a_file_that_is_none_count_as_missing(done):
    whole = (done.out / NOTE).read_bytes()
    for about, change in ODD.items():
        (done.out / NOTE).write_bytes(whole)
        rewrite(done, change)
        ledger = Ledger(done.out)
        assert ledger.state(TASK) == "missing" and not getattr(ledger.receipt(TASK), "files", {}), about
    for content in (b"[" * 100_000, b"{" * 5, b"\xff\xfe", b"null", b"7", b" " * (2 << 20)):
        (done.out / NOTE).write_bytes(content)
        ledger = Ledger(done.out)
        assert ledger.state(TASK) == "missing" and not ledger.adopt(TASK)
        failed = done.out / "ledger" / f"{TASK.id}.failed.json"
        failed.write_bytes(content)
        assert ledger.reason(TASK) == ""
        failed.unlink()


class About(fake.Fake):
    about: dict[str, Any]


def test_a_receipt_says_in_short_what_its_task_depended_on(done):
    about = {"warp": {"bend": 1.5}, "thick": 2.0, "long": "x" * 25, "none": {}, "short": "y" * 24}
    tasks = [About(name="about", about=about | {"long": letter * 25}) for letter in "xz"]
    fake.done(done.out, *tasks)
    first, other = (done.receipt(task).identity for task in tasks)
    assert first.keys() >= {"versions.fake", "fails", *(f"about.{key}" for key in about)}
    assert (first["versions.fake"], first["about.thick"], first["about.short"]) == (1, 2.0, "y" * 24)
    hashed = [first[f"about.{key}"] for key in ("warp", "long", "none")]
    assert all(value.startswith("#") and len(value) == 9 for value in hashed)
    assert {key for key in first if first[key] != other[key]} == {"about.long"}
    (done.out / "ledger" / f"{'0' * 16}.json").write_text("{}")
    done.fail(TASK, "for the test")
    assert [receipt.task for receipt in done.receipts([task.id for task in tasks])] == [TASK.id]


@given(st.data())
def test_every_flipped_byte_of_a_receipt_is_found(data):
    files = {"y": Product(sha256="ab" * 32, bytes=12)}
    receipt = Receipt(task="a" * 16, stage="train", title="rows 0–9", files=files, seconds=1.5, identity={"seed": 3})
    whole = receipt.sealed()
    place, mask = data.draw(st.integers(0, len(whole) - 1)), data.draw(st.integers(1, 255))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "receipt.json"
        path.write_bytes(whole)
        found = Receipt.read(path, "a" * 16)
        assert found is not None and found.encoded() == whole
        assert found.model_dump(exclude={"checksum"}) == receipt.model_dump(exclude={"checksum"})
        path.write_bytes(whole[:place] + bytes([whole[place] ^ mask]) + whole[place + 1 :])
        assert Receipt.read(path, "a" * 16) is None


@pytest.mark.parametrize("sound", [True, False])
def test_another_data_set_adopts_a_shard_it_shares_if_it_is_sound(done, sound):
    content = (done.out / PRODUCT).read_bytes()
    (done.out / PRODUCT).write_bytes(content if sound else content[::-1])
    twin = fake.task("x", folder="datasets/b-2")
    assert twin.id == TASK.id and done.state(twin) == "missing"
    assert bool(done.adopt(twin)) == sound == (done.out / twin.products[0]).exists()
    if sound:
        assert (done.out / twin.products[0]).read_bytes() == content
        assert done.state(TASK) == done.state(twin) == "done"


def test_one_run_at_a_time_or_several_parts_in_a_folder_that_can_be_written(tmp_path):
    first, second = Store.of(tmp_path), Store.of(tmp_path)
    with first.held(), pytest.raises(WorkFailed, match="another run is at work"), second.held():
        pass
    with second.held():
        (tmp_path / "file").touch()
    with first.held(shared=True), second.held(shared=True), pytest.raises(WorkFailed, match="another run"):
        Store.of(tmp_path).held().__enter__()
    with first.held(), pytest.raises(WorkFailed, match="another run"), second.held(shared=True):
        pass
    with pytest.raises(BadInput, match="--out must name a folder"), Store.of(tmp_path / "file" / "out").held():
        pass


@pytest.fixture
def ledger(tmp_path):
    (tmp_path / "ledger").mkdir()
    return Ledger(tmp_path)


@pytest.mark.parametrize(
    ("before", "now", "why"),
    [
        ([], {}, NEVER_MADE),
        ([{}], {}, None),
        ([{"seconds": 0.01}], {"seconds": 0.02, "breaks": True}, "changed: breaks False → True, seconds 0.01 → 0.02"),
        # The most similar one counts.
        ([{"seconds": 0.01}, {"seconds": 0.02, "breaks": True}], {"breaks": True}, "changed: seconds 0.02 → 0.0"),
        # A version comes first; long values and ids are not shown.
        ([{"version": 2}], {"after": ("0" * 16,)}, "changed: versions.fake 2 → 1, after"),
    ],
)
def test_what_has_changed_since_a_task_was_made_is_named(ledger, monkeypatch, before, now, why):
    for fields in before:
        with monkeypatch.context() as patch:
            patch.setattr(fake.Fake, "versions", lambda self: {"fake": fields.get("version", 1)})  # noqa: B023
            fake.done(ledger.out, fake.Fake(name="shard", **{key: fields[key] for key in fields.keys() - {"version"}}))
    tasks = [fake.Fake(name="shard", **fields) for fields in (now, {"seconds": 9.0})]  # two data sets may share a title
    assert reasons(tasks, ledger).get(tasks[0].id) == why and tasks[1].id in reasons(tasks, ledger)


def test_failures_and_damage_are_told_apart(ledger):
    failed, damaged = fake.task("failed"), fake.task("damaged")
    ledger.fail(failed, "the disk was full")
    fake.done(ledger.out, damaged)
    (ledger.out / damaged.products[0]).unlink()
    why = {failed.id: "failed: the disk was full", damaged.id: "a product is missing or damaged"}
    assert reasons([failed, damaged], ledger) == why
