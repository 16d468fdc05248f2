import math

import pandas as pd
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reports.measure.extremes import LUSTROUS, error_name, lustrous
from reports.over_seeds import mean
from reports.record import Provenance, Record
from reports.tables import summary
from tests.reports.conftest import retrained
from weaves.fabric import load_fabric


def error(method, setting, fabric, role, mse, noise=0.0, spread=0.0):
    subject = Record(method=method, setting=setting, fabric=fabric, role=role, scene="queries")
    others = {"mse_measured": mse + noise, "truth_noise": noise, "colour_rrmse": math.sqrt(abs(mse))}
    records = [subject.of(name, value, 100) for name, value in others.items()]
    return [subject.of("mse", mse, 100, standard_error=spread), *records]


PICTURES = [("denim", "sphere", "mse", 0.5), ("denim", "plane", "mse", 0.7), ("denim", "plane", "flicker", 0.1)]
PICTURES += [("basket", "plane", "flicker", 0.3)]
PICTURES += [("denim", "plane", "excess_energy", -0.1), ("basket", "plane", "excess_energy", -0.3)]
RECORDS = [
    *error("woven", "", "denim", "seen", 1.0, noise=0.25, spread=0.03),
    *error("woven", "", "basket", "seen", 3.0, noise=0.75, spread=0.04),
    *error("woven", "", "twill_4_4", "unseen", 2.0),
    *error("neumip", "", "denim", "seen", 2.0),
    *error("point_sampled", "k = 1", "denim", "seen", 12.0),
    *error("point_sampled", "k = 2", "denim", "seen", 6.0),
    *error("point_sampled", "k = 2", "basket", "seen", 10.0),
    *error("point_sampled", "k = 2", "twill_4_4", "unseen", 5.0),
    *(Record(method="woven", fabric=f, role="seen", scene=s, metric=m, value=v) for f, s, m, v in PICTURES),
    Record(method="woven", metric="time", value=400.0),
    Record(method="woven", role="unseen", metric="time", value=900.0),
    Record(method="point_sampled", setting="k = 2", metric="time", value=500.0),
    Record(method="truth", metric="time", value=50_000.0),
    Record(method="woven", metric="bytes_stored", value=350_000.0),
]


def row(table, **keys):
    (found,) = [r for r in summary.rows(table) if all(getattr(r, key) == value for key, value in keys.items())]
    return found


def test_errors_are_means_and_those_of_unseen_fabrics_geometric():
    """The baseline errs 5 and 8, woven 2 and .8: ratios 2.5 and 10, colour errors sqrt(2) and sqrt(.8)."""
    more = [*error("woven", "", "crepe", "unseen", 0.8), *error("point_sampled", "k = 2", "crepe", "unseen", 8.0)]
    table = summary.error_table([*RECORDS, *more])
    woven = row(table, method="woven", role="unseen")
    assert woven.fabrics == 2 and woven.ratio == pytest.approx(13.0 / 2.8)
    assert (woven.ratio_fabrics, woven.mse_fabrics) == pytest.approx((5.0, math.sqrt(1.6)))
    assert summary.summary_table([*RECORDS, *more]).loc[("woven", ""), "× lower, unseen"] == pytest.approx(5.0)
    woven = row(summary.error_table(RECORDS), method="woven", role="seen")
    assert (woven.fabrics, woven.queries) == (2, 200) and woven.mse == pytest.approx(2.0)
    assert woven.standard_error == pytest.approx(0.05 / 2)  # sqrt(.03^2 + .04^2) / 2
    assert (woven.low, woven.high) == pytest.approx((2 - 1.96 * 0.025, 2 + 1.96 * 0.025))
    assert woven.noise_share == pytest.approx(0.5 / 2.5) and woven.ratio == pytest.approx(8.0 / 2.0)
    assert woven.ratio_low < 4 < woven.ratio_high
    by_fabric = summary.fabric_table(RECORDS)
    assert by_fabric["fabric"].tolist() == ["denim", "basket", "twill_4_4"]
    assert by_fabric["point_sampled k = 2"].tolist() == [6.0, 10.0, 5.0] and math.isnan(by_fabric["neumip"][1])
    assert summary.picture_table(RECORDS)[["scene", "mse"]].to_numpy().tolist() == [["sphere", 0.5], ["plane", 0.7]]


def test_a_ratio_compares_the_fabrics_that_both_cover_above_the_noise():
    """NeuMIP answers for denim alone: there 2 points have 6, not the 8 of both fabrics."""
    table = summary.error_table(RECORDS)
    assert row(table, method="neumip").ratio == pytest.approx(3.0)
    assert row(table, method="woven", role="unseen").ratio == pytest.approx(2.5)
    alone = [record for record in RECORDS if record.setting != "k = 2" or record.fabric != "basket"]
    assert math.isnan(row(summary.error_table(alone), method="woven", role="seen").ratio)
    table = summary.error_table([*error("m", "", "denim", "seen", -0.1), *error("p", "k = 2", "denim", "seen", 1.0)])
    assert math.isnan(row(table, method="m").ratio)


def test_summary_is_one_row_a_method_with_aliasing_timing_and_mean_spectra():
    alias = row(summary.aliasing_table(RECORDS), method="woven")
    assert (alias.fabrics, alias.flicker, alias.excess_energy) == pytest.approx((2, 0.2, -0.2))
    timing = summary.timing_table(RECORDS)
    woven, truth = row(timing, method="woven"), row(timing, method="truth")
    assert (woven.median_ns, woven.time_ratio, woven.bytes_stored) == pytest.approx((400, 0.8, 350_000))
    assert woven.unseen_ns == 900.0 and math.isnan(truth.unseen_ns)
    assert truth.time_ratio == pytest.approx(100) and math.isnan(truth.bytes_stored)
    # 400 ns a query are .83 s a frame of 1920 by 1080.
    assert woven.frame_ms == pytest.approx(829.44)
    assert math.isnan(woven.most_threads_ns) and math.isnan(woven.prepare_ms) and math.isnan(woven.memory)
    curves = [((0.1, 1.0), (0.2, 2.0)), ((0.1, 3.0), (0.2, 4.0))]
    records = [Record(method="m", metric="spectrum", fabric=f"f{i}", curve=curve) for i, curve in enumerate(curves)]
    assert summary.spectra(records) == {("m", ""): [(0.1, 2.0), (0.2, 3.0)]}
    table = summary.summary_table(RECORDS)
    assert list(table.index) == [("woven", ""), ("neumip", ""), ("point_sampled", "k = 1"), ("point_sampled", "k = 2")]
    assert table.loc[("woven", ""), "× lower, seen"] == pytest.approx(4.0)
    assert table.loc[("woven", ""), "× time"] == pytest.approx(0.8)
    assert math.isnan(table.loc[("neumip", ""), "MSE unseen"]) and summary.summary_table([]).empty


def test_extremes_keep_the_worst_energy_too_and_silhouettes_are_means_over_fabrics():
    shiny = lustrous(load_fabric("polyester_lining"))
    assert (shiny.warp.roughness, shiny.weft.roughness) == (LUSTROUS, LUSTROUS)
    subject = Record(method="m", setting="s")
    curve = ((1e-4, 0.5), (1.0, 0.1))
    records = [
        subject.model_copy(update={"fabric": name}).of("extreme_error", value, 9, curve=points)
        for name, value, points in (("a", 0.5, curve), ("b", 0.2, ((1.0, 0.2),)), (shiny.name, 0.9, curve))
    ]
    records += [subject.of("extreme_not_finite", 3.0, 90), subject.of("extreme_not_finite", 1.0, 90)]
    (row,) = summary.extremes_table([*records, subject.of("mse", 1.0, 9)]).to_dict("records")
    assert (row[error_name(1e-4)], row[error_name(1.0)], row["lustrous"]) == (0.5, 0.2, 0.9)
    assert math.isnan(row[error_name(1e4)]) and math.isnan(row["rounding"])
    assert (row["not_finite"], row["answers"], row["negative"]) == (4, 180, 0)
    records = []
    for fabric, value in (("denim", 0.5), ("basket", 0.9), ("voile", 0.7)):
        subject = Record(method="m", fabric=fabric, scene="queries")
        names = ("furnace_diffuse", "furnace_specular", "furnace_colour", "silhouette_coverage")
        factors = zip(names, (1.0, 0.5, 0.25, -1.0), strict=True)
        records += [subject.of(name, factor * value, 9) for name, factor in factors]
    (worst,), (edge,) = summary.rows(summary.energy_table(records)), summary.rows(summary.silhouette_table(records))
    assert (worst.furnace_diffuse, worst.furnace_specular, worst.furnace_colour, worst.fabrics) == (0.9, 0.45, 0.225, 3)
    assert (edge.silhouette_coverage, edge.fabrics) == (pytest.approx(-0.7), 3) and math.isnan(edge.silhouette_light)


def test_trained_numbers_are_means_with_ranges_unless_trained_once():
    """MSE of 2, 4 and 6 on the seen fabrics; 2 points have 8 there."""
    records = retrained(RECORDS, {"woven": (4, 5, 6)})
    woven = row(summary.error_table(records), method="woven", role="seen")
    assert (woven.seeds, woven.mse, woven.mse_least, woven.mse_most) == pytest.approx((3, 4.0, 2.0, 6.0))
    assert (woven.ratio, woven.ratio_least, woven.ratio_most) == pytest.approx((2.0, 8 / 6, 8 / 2))
    alias = row(summary.aliasing_table(records), method="woven")
    assert (alias.flicker, alias.flicker_least, alias.flicker_most) == pytest.approx((0.4, 0.2, 0.6))
    for statistic, factor in ((mean, 2.0), (min, 1.0), (max, 3.0)):
        assert summary.fabric_table(records, statistic)["woven"].tolist() == [factor, 3.0 * factor, 2.0 * factor]
    assert summary.picture_table(records).equals(summary.picture_table(RECORDS)), "pictures are of the first training"
    once = retrained(RECORDS, {"woven": (3,)})
    assert summary.unranged(summary.error_table(once)) == {("unseen", "woven", "")}
    assert math.isnan(summary.summary_table(once).loc[("woven", ""), "× lower, unseen"])
    for records in (RECORDS, retrained(RECORDS, {"woven": (4, 5)})):
        assert summary.unranged(summary.error_table(records)) == set()


def test_means_over_fabrics_and_albedos_lie_within_the_range_of_the_trainings():
    """Ratios of 2, 32 and 32, 2 on two fabrics have a geometric mean of 8 in both trainings, not that of 17 and 17."""
    records = error("point_sampled", "k = 2", "denim", "unseen", 64.0)
    records += error("point_sampled", "k = 2", "basket", "unseen", 64.0)
    for seed, errors in enumerate(((2.0, 32.0), (32.0, 2.0))):
        about = {"provenance": Provenance(model="net", seed=seed)}
        for fabric, value in zip(("denim", "basket"), errors, strict=True):
            found = error("net", "", fabric, "unseen", value)
            found.append(found[0].of("furnace_diffuse", value, 9))
            found += [found[0].of(f"furnace_{name}", 0.5, 9) for name in ("specular", "colour")]
            records += [one.model_copy(update=about) for one in found]
    net = row(summary.error_table(records), method="net")
    names = ["ratio_fabrics", "ratio_fabrics_least", "ratio_fabrics_most", "mse_fabrics"]
    assert [getattr(net, name) for name in names] == pytest.approx([8.0] * 4) and net.ratio == pytest.approx(64 / 17)
    albedo = row(summary.energy_table(records), method="net")
    assert [getattr(albedo, f"furnace_diffuse{end}") for end in ("", "_least", "_most")] == [32.0] * 3


def test_intervals_and_ratios_are_those_over_the_same_fabrics():
    """Logarithms -1, 0 and 1: s = 1, and t_{.975, 2} = 4.302653 (tables of Student's distribution)."""
    reach = 4.302653 / math.sqrt(3)
    expected = (1.0, math.exp(-reach), math.exp(reach))
    assert summary.over_fabrics([math.exp(-1), 1.0, math.e]) == pytest.approx(expected, rel=1e-6)
    assert summary.over_fabrics([0.25] * 4) == pytest.approx((0.25, 0.25, 0.25))
    assert summary.over_fabrics([0.3]) == pytest.approx((0.3, math.nan, math.nan), nan_ok=True)
    for lost in ([], [0.1, 0.0], [0.1, -0.2], [0.1, math.nan], [0.1, math.inf]):
        assert all(map(math.isnan, summary.over_fabrics(lost))), "errors lost in the noise have no mean"
    # The baseline errs 100 and 1; the method a thousandth and a tenth of it: geometric mean 100.
    base = pd.DataFrame({"fabric": ["b", "a"], "mse": [100.0, 1.0]})
    errors = pd.DataFrame(
        {"fabric": ["a", "b"], "mse": [0.1, 0.1], "colour_rrmse": [0.04, 0.01], "rrmse_specular_warp": [0.3, math.nan]}
    )
    found = summary.columns_over_fabrics(errors, base)
    assert found["ratio_fabrics"] == pytest.approx(100.0)
    assert found["ratio_fabrics_low"] < 10.0 and found["ratio_fabrics_high"] > 1000.0
    assert found["colour_rrmse_fabrics"] == pytest.approx(0.02)
    # On fabric b the component is nowhere seen, another one was not measured.
    assert found["rrmse_specular_warp_fabrics"] == pytest.approx(0.3)
    assert math.isnan(found["rrmse_specular_warp_fabrics_low"]) and math.isnan(found["rrmse_diffuse_warp_fabrics"])
    alone = summary.columns_over_fabrics(errors, base.iloc[:0])
    assert math.isnan(alone["ratio_fabrics"]) and alone["mse_fabrics"] == pytest.approx(0.1)


# Few values, so that ties are frequent; and some that were not measured.
NUMBERS = st.sampled_from([0.0, 1.0, 2.0, 3.0, 5.0, 8.0]) | st.floats(-1e9, 1e9) | st.sampled_from([math.nan, math.inf])
POINTS = st.lists(st.tuples(NUMBERS, NUMBERS), max_size=30)


def on_front(points):
    return summary.front(pd.DataFrame(points, columns=["time", "error"], dtype=float), "time", "error").tolist()


def measured(point):
    return math.isfinite(point[0]) and math.isfinite(point[1])


def beats(one, other):
    return measured(one) and one[0] <= other[0] and one[1] <= other[1] and one != other


@given(POINTS)
@example([(1.0, 2.0), (1.0, 2.0), (1.0, 3.0), (2.0, 2.0), (2.0, 1.0)])
def test_nothing_beats_the_front_and_something_on_it_beats_all_others(points):
    best = [point for point, on in zip(points, on_front(points), strict=True) if on]
    for point, on in zip(points, on_front(points), strict=True):
        assert on == (measured(point) and not any(beats(other, point) for other in points))
        assert on or not measured(point) or any(beats(other, point) for other in best)
