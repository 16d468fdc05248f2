from types import SimpleNamespace

import pytest

from jobs.run.crew import Crew
from jobs.run.software import software
from weaves.errors import WorkFailed


def crew(there):
    """Return the crew of a scheduler whose one worker answers a query of its software so."""
    client = SimpleNamespace(
        subscribe_topic=lambda *given: None,
        nthreads=lambda: {"tcp://a": 1},
        run=lambda function, workers, on_error: dict.fromkeys(workers, there),
    )
    return Crew(client, True, lambda message: None)


def test_a_worker_of_equal_software_is_accepted():
    assert crew(dict(software())).accepted == ["tcp://a"]
    assert "+" not in "".join(software().values())  # builds for other devices are one version


@pytest.mark.parametrize("name", list(software()))
def test_each_difference_is_named_with_both_versions(name):
    with pytest.raises(WorkFailed) as refused:
        crew(software() | {name: "0.1"})
    assert f"tcp://a gets no task: it has {name} 0.1 (here {software()[name]}); install" in str(refused.value)


def test_what_a_worker_cannot_say_is_named():
    with pytest.raises(WorkFailed, match=rf"(missing.*){{{len(software())}}}"):
        crew({})
    with pytest.raises(WorkFailed, match=r"it has no twillight of this version \(ModuleNotFoundError\)"):
        crew(ModuleNotFoundError("jobs"))
