"""Records condensed to frames: one row a method, over all fabrics of a role.

Means over fabrics weigh every fabric alike, as one picture of all of them would. A ratio compares a method with point
sampling at 2 points on the very fabrics that the method covers; its interval is that of `reports.error.ratio`. Numbers
of networks are means over trainings, with their range (`reports.over_seeds`). The metrics of a frame are those of the
table of its name in the catalogue.

Unseen fabrics are a sample: others give other errors. The errors of a method on two fabrics differ by a factor, so that
the mean over fabrics is that of their logarithms, with an interval. Named unseen fabrics count like random ones. Of
several trainings the geometric mean is taken too, of the means and of the ends of their intervals: an interval that is
never too narrow.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd
from scipy import stats
from scipy.special import stdtrit

from pipeline.compiled.arrays import Float64, Mask
from pipeline.truth.conventions import COMPONENTS
from reports.catalogue import METRICS, OTHER, columns_of, metric_row
from reports.error import ratio
from reports.measure.extremes import FOOTPRINTS, SHINY, error_name
from reports.over_seeds import Statistic, Table, first_training, mean, over_seeds, over_trainings
from reports.record import TRUTH, Metric, Record, to_table

BASELINE: Final = ("point_sampled", "k = 2")
"""Method and setting of the baseline: point sampling at 2 points [Chen2024Woven]."""

OF_PAPER: Final = "woven"
PAPER: Final = (4.1, 0.83)
"""How much lower the MSE of the published `OF_PAPER` is, and its time relative to the baseline's [Chen2024Woven]."""

PAPER_SAYS: Final = (
    f"the paper reports {PAPER[0]}× at {PAPER[1]}× without our changes, in a picture of its own scene, on a GPU."
)
"""The same as the end of a sentence on `woven`."""

_FRAME: Final = 1920 * 1080  # queries of a frame, one a pixel

ERRORS: Final[tuple[Metric, ...]] = ("mse", "colour_rrmse", *(f"rrmse_{name}" for name in COMPONENTS))
"""Metrics on held-out queries that have a mean over fabrics with an interval."""

_OVER_FABRICS: Final = tuple(f"{name}_fabrics" for name in ("ratio", *ERRORS))
_KEYS: Final = ["method", "setting"]
_MEANS: Final = [name for name in (*columns_of("errors"), "zero_answers") if name != "mse"]  # of `error_table`


def of_baseline(table: pd.DataFrame) -> pd.Series[bool]:
    """Return which rows of a table with `method` and `setting` are the baseline's."""
    return (table["method"] == BASELINE[0]) & (table["setting"] == BASELINE[1])


@over_seeds(
    [*_KEYS, "role"],
    ["ratio", "mse", *_MEANS, *_OVER_FABRICS],
    {f"{name}{end}": stats.gmean for name in _OVER_FABRICS for end in ("", "_low", "_high")},
)
def error_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return errors on held-out queries, one row a method and role.

    Columns: method, setting, role, fabrics, queries; mse, standard_error, low, high (of the mean over fabrics);
    mse_measured, truth_noise, noise_share = truth_noise / mse_measured; ratio, ratio_low, ratio_high (MSE of 2
    points over the method's); zero_answers and the other columns of `errors` in the catalogue (means over fabrics);
    geometric means over fabrics, and over trainings, with their intervals (`columns_over_fabrics`).
    """
    wide = _wide(records, "queries")
    result = []
    for (method, setting, role), group in wide.groupby([*_KEYS, "role"], sort=False):
        baseline = _baseline(wide, role, set(group["fabric"]))
        mse, spread = _mean_error(group)
        base, base_spread = _mean_error(baseline)
        ratios = ratio((base, base_spread), (mse, spread)) if mse > 0 and base > 0 else (math.nan,) * 3
        row: dict[str, Any] = {"method": method, "setting": setting, "role": role, "fabrics": len(group)}
        row |= {"queries": int(group["count"].sum()), "mse": mse, "standard_error": spread}
        row |= {"low": mse - 1.96 * spread, "high": mse + 1.96 * spread}
        row |= {name: float(group[name].mean()) for name in ("mse_measured", "truth_noise")}
        row["noise_share"] = row["truth_noise"] / row["mse_measured"] if row["mse_measured"] > 0 else math.nan
        row |= dict(zip(("ratio", "ratio_low", "ratio_high"), ratios, strict=True))
        row |= {name: group[name].mean() if name in group else math.nan for name in _MEANS}
        result.append(row | columns_over_fabrics(group, baseline))
    return pd.DataFrame(result)


def fabric_table(records: Sequence[Record], statistic: Statistic = mean) -> pd.DataFrame:
    """Return the MSE on held-out queries, a statistic of all trainings.

    One row a fabric and one column a method (``method setting``).
    """
    table = to_table(over_trainings(records, statistic))
    table = table[(table["metric"] == "mse") & (table["scene"] == "queries")]
    labels = (table["method"] + " " + table["setting"]).str.strip()
    wide = table.assign(label=labels).pivot(index=["role", "fabric"], columns="label", values="value")
    keys = list(dict.fromkeys(zip(table["role"], table["fabric"], strict=True)))
    return wide.reindex(index=keys, columns=labels.unique()).reset_index().rename_axis(columns=None)


def picture_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return the MSE of the pictures, which networks make after their first training.

    Columns: method, setting, fabric, scene, mse, mse_measured, truth_noise.
    """
    records = first_training(records)
    columns = [*_KEYS, "role", "fabric", "scene", "mse", "mse_measured", "truth_noise"]
    parts = [part for part in (_wide(records, scene) for scene in ("sphere", "plane")) if "mse" in part]
    if not parts:
        return pd.DataFrame(columns=columns)
    return pd.concat([part[part["mse"].notna()] for part in parts], ignore_index=True).reindex(columns=columns)


def _over_fabrics(name: str, keys: Sequence[str], statistic: Literal["mean", "max"]) -> Table:
    """Return a table, one row a key: the number of fabrics, and a statistic over them of each metric of a name."""
    metrics = columns_of(name)

    @over_seeds(keys, metrics, {} if statistic == "mean" else dict.fromkeys(metrics, mean))
    def condensed(records: Sequence[Record]) -> pd.DataFrame:
        table = to_table(records)
        table = table[table["metric"].isin(metrics) & (table["method"] != TRUTH) & (table["fabric"] != "")]
        if table.empty:
            return pd.DataFrame(columns=[*keys, "fabrics", *metrics])
        fabrics = table.groupby([*keys], sort=False)["fabric"].nunique().rename("fabrics").to_frame()
        wide = table.pivot_table("value", [*keys], "metric", statistic, sort=False).reindex(columns=metrics)
        return fabrics.join(wide).reset_index()

    return condensed


aliasing_table = _over_fabrics("aliasing", [*_KEYS, "role"], "mean")
energy_table = _over_fabrics("energy", _KEYS, "max")
silhouette_table = _over_fabrics("silhouettes", _KEYS, "mean")


_SCENE: Final = [*columns_of("scenes"), "mse", "mse_relative", "colour_rrmse", "flicker", "excess_energy"]
_FLOORS: Final = ["truth_noise", *(name for name in METRICS if name.endswith("_floor"))]
_FIXED: Final = ("fallback_share", "frame_time")  # not of the weights of a network


@over_seeds(["scene", *_KEYS], [*(name for name in _SCENE if name not in _FIXED), "ratio"])
def scene_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return the benchmark's scenes, one row a scene, method and setting.

    Columns: scene, method, setting; the columns of `scenes` in the catalogue, mse, mse_relative, colour_rrmse, flicker
    and excess_energy, and the scores of the truth's noise alone; of those that depend on the weights of a network the
    ends of the 95 % interval, <metric>_low and <metric>_high; ratio (MSE of 2 points over the method's); front (nothing
    beats it on both MSE and time in its scene). An MSE that is not above 0, lost in the noise of the truth, has no
    ratio and is on no front.
    """
    table = to_table(records)
    metrics, intervals = [*_SCENE, *_FLOORS], [name for name in _SCENE if name not in _FIXED]
    table = table[(table["fabric"] == "") & (table["scene"] != "") & table["metric"].isin(metrics)]
    keys, ends = ["scene", *_KEYS], [f"{name}_{end}" for name in intervals for end in ("low", "high")]
    if table.empty:
        return pd.DataFrame(columns=[*keys, *metrics, *ends, "ratio", "front"])
    wide = table.pivot(index=keys, columns="metric", values=["value", "low", "high"])
    names: Any = wide.columns
    wide.columns = [name if part == "value" else f"{name}_{part}" for part, name in names]
    order = pd.MultiIndex.from_frame(table[keys].drop_duplicates())
    wide = wide.reindex(index=order, columns=[*metrics, *ends]).reset_index()
    base = wide[of_baseline(wide)].set_index("scene")["mse"]
    positive = wide.assign(mse=wide["mse"].where(wide["mse"] > 0))
    wide["ratio"] = wide["scene"].map(base) / positive["mse"]
    wide["front"] = False
    for _, group in positive.groupby("scene"):
        wide.loc[group.index, "front"] = front(group, "frame_time", "mse")
    return wide


def path_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return errors between fabrics, one row a share of a path: method, setting, fabric, to, how, share, error."""
    ways = {"path_error": "latents blended", "reencode_error": "encoded anew"}
    lines = [
        (record.method, record.setting, record.fabric, record.note, ways[record.metric], share, error)
        for record in records
        if record.metric in ways
        for share, error in record.curve
    ]
    return pd.DataFrame(lines, columns=[*_KEYS, "fabric", "to", "how", "share", "error"])


def timing_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return what answers cost, one row a method.

    Columns: method, setting; on the fewest threads that were timed median_ns, first_quartile_ns, third_quartile_ns (a
    query), repeats, threads and frame_ms; on the most, where those are more, most_threads, most_threads_ns and
    most_threads_frame_ms; processor_time and energy on the fewest, where measured; bytes_stored, memory (bytes a call
    adds), prepare_ms; unseen_ns, the median on all unseen fabrics; time_ratio, the time over that of 2 points. A frame
    is 1920 × 1080 queries.
    """
    table = to_table(records)
    times = table[table["metric"] == "time"]
    unseen, times = (times[times["role"] == role] for role in ("unseen", ""))
    threads = times.groupby(_KEYS, sort=False)["threads"]
    fewest, most = threads.transform("min"), threads.transform("max")
    names = {"value": "median_ns", "low": "first_quartile_ns", "high": "third_quartile_ns", "count": "repeats"}
    result = times[times["threads"] == fewest].rename(columns=names).set_index(_KEYS)[[*names.values(), "threads"]]
    more = times[(times["threads"] == most) & (most > fewest)].set_index(_KEYS)[["threads", "value"]]
    result = result.join(more.set_axis(["most_threads", "most_threads_ns"], axis=1))
    result["frame_ms"] = result["median_ns"] * _FRAME / 1e6
    result["most_threads_frame_ms"] = result["most_threads_ns"] * _FRAME / 1e6
    names = {"bytes_stored": "bytes_stored", "peak_memory": "memory", "prepare_time": "prepare_ms"}
    names |= {metric: metric for metric in ("processor_time", "energy") if metric in {*table["metric"]}}
    for metric, name in names.items():
        costs = table[(table["metric"] == metric) & (table["role"] == "")]
        costs = costs[costs["threads"] == costs["threads"].min()]
        result = result.join(costs.set_index(_KEYS)["value"].rename(name))
    result = result.join(unseen.set_index(_KEYS)["value"].rename("unseen_ns")).reset_index()
    base = result.loc[of_baseline(result), "median_ns"]
    result["time_ratio"] = result["median_ns"] / float(base.iloc[0]) if len(base) else math.nan
    return result


@over_seeds(_KEYS, None)
def other_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return the metrics without a table of their own: one row a method, one column a metric, means over Records."""
    table = to_table(records)
    others = {name for name in table["metric"] if metric_row(name).table == OTHER}
    names = [name for name in dict.fromkeys((*METRICS, *table["metric"])) if name in others]
    if not names:
        return pd.DataFrame(columns=_KEYS)
    chosen = table[table["metric"].isin(names)]
    wide = chosen.pivot_table("value", _KEYS, "metric", "mean", sort=False)[names]
    return wide.reset_index().rename_axis(columns=None)


def extremes_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return the extremes, one row a method: the worst over its fabrics and trainings, those of alpha = .01 apart.

    Columns: method, setting, fabrics; error_<footprint> for each of `FOOTPRINTS`, grazing, lustrous (worst of all
    footprints on the cloths of alpha = .01); rounding, far, large (NaN where not measured); not_finite, negative,
    `answers` (their number).
    """
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        if record.metric.startswith("extreme_"):
            groups.setdefault((record.method, record.setting), []).append(record)
    return pd.DataFrame([_extremes(*key, group) for key, group in groups.items()])


def _extremes(method: str, setting: str, records: Sequence[Record]) -> dict[str, object]:
    def worst(metric: Metric, shiny: bool | None = None) -> float:
        values = [r.value for r in records if r.metric == metric and shiny in (None, r.fabric.endswith(SHINY))]
        return max(values, default=math.nan)

    def total(metric: Metric) -> int:
        return int(sum(record.value for record in records if record.metric == metric))

    plain = [dict(r.curve) for r in records if r.metric == "extreme_error" and not r.fabric.endswith(SHINY)]
    row: dict[str, object] = {"method": method, "setting": setting, "fabrics": len({r.fabric for r in records})}
    row |= {error_name(size): max((c[size] for c in plain if size in c), default=math.nan) for size in FOOTPRINTS}
    row |= {"grazing": worst("extreme_grazing", False), "lustrous": worst("extreme_error", True)}
    row |= {name: worst(f"extreme_{name}") for name in ("rounding", "far", "large")}
    row |= {"not_finite": total("extreme_not_finite"), "negative": total("extreme_negative")}
    return row | {"answers": sum(record.count for record in records if record.metric == "extreme_not_finite")}


def spectra(records: Sequence[Record]) -> dict[tuple[str, str], list[tuple[float, float]]]:
    """Return the power spectrum of each method and of the truth, averaged over fabrics."""
    curves: dict[tuple[str, str], list[Float64]] = {}
    for record in records:
        if record.metric == "spectrum":
            curves.setdefault((record.method, record.setting), []).append(np.array(record.curve))
    return {
        key: [(float(k), float(p)) for k, p in np.mean(parts, axis=0)]
        for key, parts in curves.items()
        if len({len(curve) for curve in parts}) == 1
    }


def summary_table(records: Sequence[Record]) -> pd.DataFrame:
    """Return the whole benchmark as one row a method, for the terminal.

    Index: method and setting. Columns, where measured: MSE and ratio to 2 points on seen and unseen fabrics (on several
    unseen fabrics the geometric mean of the ratio; none of `unranged`), flicker, nanoseconds a query and their ratio to
    2 points, bytes stored.
    """
    parts = []
    errors = error_table(records)
    if len(errors):
        keys = zip(errors["role"], errors["method"], errors["setting"], strict=True)
        left_out = unranged(errors)
        errors.loc[[key in left_out for key in keys], ["mse", "ratio", "ratio_fabrics"]] = math.nan
        errors["ratio"] = [row.ratio_fabrics if over_unseen(row) else row.ratio for row in rows(errors)]
    for role in ("seen", "unseen"):
        part = errors[errors["role"] == role].set_index(_KEYS)[["mse", "ratio"]] if len(errors) else pd.DataFrame()
        if len(part):
            parts.append(part.rename(columns={"mse": f"MSE {role}", "ratio": f"× lower, {role}"}))
    aliasing = aliasing_table(records)
    if len(aliasing):
        parts.append(aliasing.groupby(_KEYS, sort=False)[["flicker"]].mean())
    timing = timing_table(records)
    timing = timing[timing["method"] != TRUTH]
    if len(timing):
        columns = {"median_ns": "ns/query", "time_ratio": "× time", "bytes_stored": "bytes"}
        parts.append(timing.set_index(_KEYS)[list(columns)].rename(columns=columns))
    return pd.concat(parts, axis=1) if parts else pd.DataFrame()


def rows(table: pd.DataFrame) -> Iterator[Any]:
    """Iterate over the rows of a table as tuples named by its columns."""
    return iter(table.itertuples())


def parts_of(frame: pd.DataFrame, column: str) -> list[tuple[str, pd.DataFrame]]:
    """Return the parts of a frame by the values of a column, in their order."""
    return [(str(name), part) for name, part in frame.groupby(column, sort=False)] if len(frame) else []


def _wide(records: Sequence[Record], scene: str) -> pd.DataFrame:
    """Return one row a method and fabric with a column for each metric of a scene; the truth's own left out."""
    table = to_table(records)
    table = table[(table["scene"] == scene) & (table["method"] != TRUTH) & (table["fabric"] != "")]
    index = [*_KEYS, "role", "fabric", "scene"]
    if table.empty:
        return pd.DataFrame(columns=[*index, "count", "mse_error"])
    order = list(dict.fromkeys(table[index].itertuples(index=False, name=None)))
    wide = table.pivot(index=index, columns="metric", values="value").reindex(order)
    mse = table[table["metric"] == "mse"].set_index(index)
    wide["count"] = mse["count"]
    wide["mse_error"] = mse["standard_error"]
    return wide.reset_index().rename_axis(columns=None)


def _mean_error(group: pd.DataFrame) -> tuple[float, float]:
    """Return the mean MSE over fabrics and its standard error, that of independent queries a fabric."""
    if group.empty:
        return math.nan, math.nan
    errors = group["mse_error"].fillna(0.0).to_numpy(dtype=np.float64)
    return float(group["mse"].mean()), float(np.sqrt(np.square(errors).sum()) / len(group))


def _baseline(wide: pd.DataFrame, role: object, fabrics: set[str]) -> pd.DataFrame:
    """Return the baseline's rows; empty unless it was measured on every one of the fabrics."""
    rows = wide[of_baseline(wide) & (wide["role"] == role) & wide["fabric"].isin(fabrics)]
    return rows if set(rows["fabric"]) == fabrics else rows.iloc[:0]


def unranged(errors: pd.DataFrame) -> set[tuple[str, str, str]]:
    """Return role, method and setting of what another training would change, and whose range is not known.

    It is what was trained once, on unseen fabrics of which there is one: over several fabrics there is an interval.
    """
    if errors.empty:
        return set()
    alone = errors[(errors["role"] == "unseen") & (errors["fabrics"] == 1) & (errors["seeds"] == 1)]
    return set(zip(alone["role"], alone["method"], alone["setting"], strict=True))


def over_fabrics(values: npt.ArrayLike) -> tuple[float, float, float]:
    """Return the geometric mean of errors or ratios, one a fabric, and its 95 % interval over fabrics.

    The mean is NaN if there is no figure, or one is not above 0, as an error that is lost in the noise of the truth;
    the interval of a single fabric is NaN too.

    Student's t interval of the mean of the logarithms: exp(m ± t_{.975, n-1} s / sqrt(n)), with n fabrics, and mean m
    and standard deviation s of the logarithms. It holds for fabrics drawn at random and normal logarithms.
    """
    figures = np.asarray(values, np.float64)
    if not len(figures) or not ((figures > 0) & np.isfinite(figures)).all():
        return math.nan, math.nan, math.nan
    logarithms = np.log(figures)
    centre = float(np.exp(logarithms.mean()))
    if len(figures) < 2:
        return centre, math.nan, math.nan
    reach = float(stdtrit(len(figures) - 1, 0.975) * stats.sem(logarithms))  # its quantile by degrees of freedom
    return centre, float(centre * np.exp(-reach)), float(centre * np.exp(reach))


def over_unseen(row: Any) -> bool:
    """Return whether a row of `error_table` is of several unseen fabrics and has an interval over them."""
    return row.role == "unseen" and math.isfinite(row.ratio_fabrics_low)


def columns_over_fabrics(errors: pd.DataFrame, base: pd.DataFrame) -> dict[str, float]:
    """Return the columns of a method that are means over fabrics; `base` has the rows of 2 points, or none.

    For `ratio` (MSE of 2 points over the method's on the same fabric) and each of `ERRORS` the geometric mean
    <name>_fabrics and the ends of its 95 % interval, <name>_fabrics_low and <name>_fabrics_high.
    """
    other = base.set_index("fabric")["mse"].reindex(errors["fabric"])
    figures = {"ratio": other.to_numpy() / errors["mse"].to_numpy()}
    # A component that is nowhere seen on a fabric has no error there.
    figures |= {name: errors[name].dropna().to_numpy() for name in ERRORS if name in errors}
    means = {name: over_fabrics(figures.get(name, ())) for name in ("ratio", *ERRORS)}
    return {
        f"{name}_fabrics{end}": number
        for name, three in means.items()
        for end, number in zip(("", "_low", "_high"), three, strict=True)
    }


def front(table: pd.DataFrame, cost: str, fault: str) -> Mask:
    """Return which rows are on the front of two columns: those that nothing beats on both.

    A row is beaten by another that is nowhere worse and somewhere better. Equal rows do not beat each other. Rows with
    NaN or infinity are not on the front and beat nothing.
    """
    points = table[[cost, fault]].to_numpy(np.float64)
    measured = np.isfinite(points).all(axis=1)
    points = np.where(measured[:, None], points, np.nan)
    others = points[:, None]
    beaten = ((others <= points).all(axis=-1) & (others < points).any(axis=-1)).any(axis=0)
    return np.asarray(measured & ~beaten)
