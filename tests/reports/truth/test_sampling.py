import math

import pytest

from pipeline.analytic.importance.lobes import STRAIGHT
from pipeline.models.patch_bsdf import PatchBSDF
from pipeline.shards.queries import QueryOptions, draw_queries
from reports.truth.sampling import RECORDS, SETTINGS, _estimates, measure, scene_looks
from tests.presets import slow
from weaves.fabric import load_fabric


@pytest.mark.parametrize(("fabric", "scene"), [("polyester_lining", ""), slow("", "plane")])
def test_lobes_save_variance_on_all_light_on_the_specular_part_and_in_scenes(fabric, scene):
    """At 3,840 directions the ratio scatters by some tens of per cent."""
    found = list(measure(looks=60, fabrics=[fabric] if fabric else [], scenes=[scene] if scene else []))
    named = [f"scene {scene}"] if scene else [fabric, f"{fabric} (specular)"]
    assert [(one.fabric, one.sampler) for one in found] == [(name, sampler) for name in named for sampler in SETTINGS]
    by_name = {(one.fabric, one.sampler): one for one in found}
    for name in named:
        base, point, lobes = (by_name[name, sampler] for sampler in ("cosine", "one point", "lobes"))
        assert base.variance_saved == base.saved_in_time == 1.0
        assert lobes.variance_saved > max(2.0, point.variance_saved)
        for one in (by_name[name, sampler] for sampler in SETTINGS):
            assert 0 < one.sample_time < one.estimate_time and one.count == 3840
            assert one.saved_in_time == pytest.approx(one.variance_saved * base.estimate_time / one.estimate_time)
    assert RECORDS.from_records(RECORDS.to_records(found)) == found


@pytest.mark.parametrize("name", [slow("voile"), slow("silk_charmeuse")])
def test_all_samplers_have_the_same_mean(name):
    """Each against the cosine, over all looks, by a z-test; chance of a false alarm 0.3 %."""
    fabric = load_fabric(name)
    looks = draw_queries(QueryOptions(max_angle=75.0), fabric.weave.repeat, 3, 0, 200)
    values = {sampler: found for sampler, (found, *_) in _estimates(fabric, looks).items()}
    for sampler in SETTINGS[1:]:
        apart = values[sampler].mean() - values["cosine"].mean()
        error = math.sqrt(sum((values[one].var(axis=1) / values[one].shape[1]).mean() for one in ("cosine", sampler)))
        assert abs(apart) < 3.3 * error / math.sqrt(len(looks.u)), sampler


@pytest.mark.slow
def test_looks_of_a_scene_are_those_of_its_pixels():
    ((fabric, looks),) = scene_looks("plane", 50)
    assert fabric.name == "denim" and len(looks.u) == 50
    assert (PatchBSDF(fabric).lobes(looks).rest[:, STRAIGHT] < 1.0).all()
    table = scene_looks("dinner_table", 200)
    assert len(table) == 4 and sum(len(looks.u) for _, looks in table) == 200
