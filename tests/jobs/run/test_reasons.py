import pytest

from jobs.run.ledger import Ledger
from jobs.run.reasons import NEVER_MADE, reasons
from tests.jobs import fake_stages as fake


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
    task = fake.Fake(name="shard", **now)
    assert reasons([task], ledger) == ({task.id: why} if why else {})


def test_failures_and_damage_are_told_apart(ledger):
    failed, damaged = fake.task("failed"), fake.task("damaged")
    ledger.fail(failed, "the disk was full")
    fake.done(ledger.out, damaged)
    (ledger.out / damaged.products[0]).unlink()
    why = {failed.id: "failed: the disk was full", damaged.id: "a product is missing or damaged"}
    assert reasons([failed, damaged], ledger) == why
