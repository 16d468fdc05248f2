"""The size of a bundle follows from measured times."""

import pytest

from jobs.plan.bundles import Bundles


@pytest.fixture
def fake(monkeypatch, request):
    monkeypatch.syspath_prepend(request.path.parents[1])
    import fake_stages

    return fake_stages


@pytest.mark.parametrize(("seconds", "size"), [(0.0, 64), (0.001, 64), (0.0201, 4), (0.04, 2), (0.06, 1), (100.0, 1)])
def test_a_bundle_takes_a_tenth_of_a_second(fake, seconds, size):
    bundles, shard = Bundles(), fake.task("shard")
    assert bundles.size == 1
    for _ in range(1000):
        bundles.ended(shard, seconds)
    assert bundles.size == size
    bundles.ended(fake.task("net", fake.FakeTraining), 1000.0)  # tells nothing about shards
    assert bundles.size == size
    bundles.ended(shard, 1.0)
    assert bundles.size == 1


def test_a_task_that_needs_others_is_in_no_bundle(fake):
    shard = fake.task("shard")
    assert Bundles.allows(shard)
    assert not Bundles.allows(fake.task("net", fake.FakeTraining))
    assert not Bundles.allows(fake.task("after", needs=[shard]))
