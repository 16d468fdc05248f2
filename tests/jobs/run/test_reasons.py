import pytest

from jobs.run.ledger import Ledger
from jobs.run.reasons import NEVER, reasons
from tests.jobs import fake_stages as fake


@pytest.fixture
def ledger(tmp_path):
    (tmp_path / "ledger").mkdir()
    return Ledger(tmp_path)


def test_done_tasks_have_no_reason_and_others_were_never_made(ledger):
    done, new = fake.task("done"), fake.task("new")
    fake.done(ledger.out, done)
    assert reasons([done, new], ledger) == {new.id: NEVER}


def test_a_changed_key_is_named_with_its_values(ledger):
    before = fake.task("shard", seconds=0.01)
    fake.done(ledger.out, before)
    now = fake.task("shard", seconds=0.02, forgets=True)
    assert reasons([now], ledger) == {now.id: "changed: forgets False → True, seconds 0.01 → 0.02"}


def test_a_version_comes_first_and_long_values_and_ids_are_not_shown(ledger, monkeypatch):
    need = fake.task("need")
    before = fake.task("shard")
    fake.done(ledger.out, before)
    monkeypatch.setattr(fake.Fake, "versions", lambda self: {"fake": 2})
    now = fake.Fake(name="shard", after=(need.id,), fails="")
    assert reasons([now], ledger) == {now.id: "changed: versions.fake 1 → 2, after"}


def test_the_most_similar_of_several_predecessors_counts(ledger):
    for seconds, breaks in ((0.01, False), (0.02, True)):
        fake.done(ledger.out, fake.task("shard", seconds=seconds, breaks=breaks))
    now = fake.task("shard", seconds=0.03, breaks=True)
    assert reasons([now], ledger) == {now.id: "changed: seconds 0.02 → 0.03"}


def test_failures_and_damage_are_told_apart(ledger):
    failed, damaged = fake.task("failed"), fake.task("damaged")
    ledger.fail(failed, "the disk was full")
    fake.done(ledger.out, damaged)
    (ledger.out / damaged.products[0]).unlink()
    assert reasons([failed, damaged], ledger) == {
        failed.id: "failed: the disk was full",
        damaged.id: "a product is missing or damaged",
    }
