"""What a sampler saves: estimates agree in the mean, and lobes beat the cosine where highlights are."""

import math

import numpy as np
import pytest

from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.shards.queries import QueryOptions, draw_queries
from reports.truth.sampling import RECORDS, SETTINGS, Subject, VarianceSaving, _estimates, measure, scene_subjects
from weaves.fabric import load_fabric


@pytest.fixture(scope="module")
def found():
    return list(measure(looks=60, fabrics=("polyester_lining",), scenes=("plane",)))


@pytest.mark.slow
def test_every_sampler_is_measured_on_all_light_on_the_specular_part_and_in_scenes(found):
    assert [(one.sampler, one.fabric) for one in found] == [
        (label, fabric)
        for fabric in ("polyester_lining", "polyester_lining (specular)", "scene plane")
        for label in SETTINGS
    ]
    base = [one for one in found if one.sampler == "cosine"]
    assert all(one.variance_saved == one.saved_in_time == 1.0 for one in base)
    assert all(0 < one.sample_time < one.estimate_time and one.count == 3840 for one in found)


def test_lobes_save_variance(found):
    """At 3,840 directions the ratio scatters by some tens of per cent."""
    saved = {(one.sampler, one.fabric): one.variance_saved for one in found}
    for fabric in ("polyester_lining", "polyester_lining (specular)", "scene plane"):
        assert saved["lobes", fabric] > 2.0
        assert saved["lobes", fabric] > saved["one point", fabric]


def test_savings_in_equal_time_are_variance_times_time(found):
    base = {one.fabric: one for one in found if one.sampler == "cosine"}
    for one in found:
        wanted = one.variance_saved * base[one.fabric].estimate_time / one.estimate_time
        assert one.saved_in_time == pytest.approx(wanted)


@pytest.mark.parametrize("name", ["organza", pytest.param("silk_charmeuse", marks=pytest.mark.slow)])
def test_all_samplers_have_the_same_mean(name):
    """Each against the cosine, over all looks, by a z-test; chance of a false alarm 0.3 %."""
    fabric = load_fabric(name)
    looks = draw_queries(QueryOptions(max_angle=75.0), fabric.weave.repeat, 3, 0, 200)
    values = {sampler: found.values for sampler, found in _estimates(Subject(fabric, looks)).items()}
    for sampler in SETTINGS[1:]:
        apart = values[sampler].mean() - values["cosine"].mean()
        error = math.sqrt(sum((values[one].var(axis=1) / values[one].shape[1]).mean() for one in ("cosine", sampler)))
        assert abs(apart) < 3.3 * error / math.sqrt(len(looks.u)), sampler


@pytest.mark.slow
def test_looks_of_a_scene_are_those_of_its_pixels():
    (plane,) = scene_subjects("plane", 50)
    assert plane.fabric.name == "denim" and len(plane.looks.u) == 50
    assert (PatchBSDF(plane.fabric).straight(plane.looks) < 1.0).all()
    table = scene_subjects("dinner_table", 200)
    assert len(table) == 4 and sum(len(subject.looks.u) for subject in table) == 200


def test_records_bring_everything_back(found):
    back = RECORDS.from_records(RECORDS.to_records(found))
    assert [(one.sampler, one.fabric, one.count) for one in back] == [(o.sampler, o.fabric, o.count) for o in found]
    for name in ("variance_saved", "saved_in_time", "sample_time", "estimate_time"):
        np.testing.assert_allclose([getattr(one, name) for one in back], [getattr(one, name) for one in found])
    assert isinstance(back[0], VarianceSaving)
