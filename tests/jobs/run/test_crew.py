from types import SimpleNamespace

import pytest

from jobs.run.crew import Crew, software
from weaves.errors import WorkFailed


def crew(there):
    """Return the crew of a scheduler whose one worker answers a query of its software so."""
    client = SimpleNamespace(
        subscribe_topic=lambda *given: None,
        nthreads=lambda: {"tcp://a": 1},
        run=lambda function, workers, on_error: dict.fromkeys(workers, there),
    )
    return Crew(client, True, lambda message: None)


def test_a_worker_of_equal_software_is_accepted_and_each_difference_is_named_with_both_versions():
    assert crew(dict(software())).accepted == ["tcp://a"]
    assert "+" not in "".join(software().values())  # builds for other devices are one version
    missing, words = rf"(missing.*){{{len(software())}}}", r"tcp://a gets no task: it has {} 0\.1 \(here {}\); install"
    different = [(software() | {name: "0.1"}, words.format(name, version)) for name, version in software().items()]
    gone = (ModuleNotFoundError("jobs"), r"it has no twillight of this version \(ModuleNotFoundError\)")
    for there, sentence in (*different, ({}, missing), gone):
        with pytest.raises(WorkFailed, match=sentence):
            crew(there)
