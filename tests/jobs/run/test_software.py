import pytest

from jobs.run.software import difference, software


def test_equal_software_has_no_difference():
    assert difference(dict(software())) == ""


@pytest.mark.parametrize("name", list(software()))
def test_each_difference_is_named_with_both_versions(name):
    other = software() | {name: "0.1"}
    assert difference(other) == f"it has {name} 0.1 (here {software()[name]})"


def test_what_a_worker_cannot_say_is_named():
    assert difference({}).count("missing") == len(software())
    assert difference(ModuleNotFoundError("jobs")) == "it has no twillight of this version (ModuleNotFoundError)"


def test_builds_of_a_library_for_other_devices_are_one_version():
    assert "+" not in "".join(software().values())
