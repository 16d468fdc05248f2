"""Catalogue of the metrics: one row a metric. A new metric is a measuring function and a row of `METRICS`.

Nothing heavy is imported here.
"""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

Better = Literal["lower", "higher", "near 0", ""]
"""Direction of a better value; empty where none is better."""

Format = Literal[
    "scientific",
    "signed",
    "percent",
    "whole percent",
    "three decimals",
    "two decimals",
    "one decimal",
    "significant",
    "grouped",
    "bytes",
]
"""How tables print a value (`reports.tables.number_format.shown`)."""

ADDED: Final = "added_"
"""Begins the names of metrics from outside the package."""

OTHER: Final = "other_metrics"
"""Table of the metrics that have no table of their own."""


class MetricRow(NamedTuple):
    """One metric."""

    name: str
    """Name in Records and tables."""
    title: str
    """Heading of its column on the page."""
    definition: str = ""
    """Explanation on the page; empty where a table's text explains it."""
    unit: str = "1"
    """Unit of its values; a Record with a unit of its own overrides it."""
    better: Better = "lower"
    """Direction of a better value."""
    format: Format = "significant"
    """How tables print a value."""
    table: str = OTHER
    """Table that shows it."""
    of_machine: bool = False
    """True if its values are those of one machine: times, rates, memory."""


METRICS: Final[dict[str, MetricRow]] = {
    metric.name: metric
    for metric in (
        # Held-out queries.
        MetricRow(
            "mse",
            "MSE",
            "Mean squared error in linear RGB of the fabric's own colours, over held-out queries and channels, the "
            "noise of the truth subtracted: MSE as measured minus noise. The truth's error is independent of the "
            "method's, so this estimates the method's own error. A row is the mean over its fabrics, each weighing "
            "alike.",
            format="scientific",
            table="errors",
        ),
        MetricRow("mse_measured", "MSE as measured", format="scientific", table="errors"),
        MetricRow("truth_noise", "noise of the truth", better="", format="scientific", table="errors"),
        MetricRow(
            "colour_rrmse",
            "colour",
            "Relative RMSE of .3 (S_warp + S_weft) + .5 (C_warp + C_weft): root of the MSE over the mean of the "
            "truth, mean over fabrics; the same colour for every fabric.",
            format="three decimals",
            table="errors",
        ),
        MetricRow(
            "colour_rrmse_99",
            "colour, 99 %",
            "The same over 99 % of the queries, those of the largest errors left out. Where almost nothing of a patch "
            "is seen, the truth is 0 by definition below a limit; a few such queries hold most of the squared error of "
            "accurate methods.",
            format="three decimals",
            table="errors",
        ),
        MetricRow(
            "rrmse_specular_warp", "S warp", "Relative RMSE, specular, warp.", format="three decimals", table="errors"
        ),
        MetricRow(
            "rrmse_specular_weft", "S weft", "Relative RMSE, specular, weft.", format="three decimals", table="errors"
        ),
        MetricRow(
            "rrmse_diffuse_warp", "C warp", "Relative RMSE, diffuse, warp.", format="three decimals", table="errors"
        ),
        MetricRow(
            "rrmse_diffuse_weft", "C weft", "Relative RMSE, diffuse, weft.", format="three decimals", table="errors"
        ),
        MetricRow("zero_answers", "answers of 0", format="percent", table="errors"),
        MetricRow("truth_relative_error", "relative error of the truth", format="percent", table="errors"),
        # Energy.
        MetricRow("furnace_diffuse", "diffuse, k_d = 1", better="", format="three decimals", table="energy"),
        MetricRow("furnace_specular", "specular, k_s = 1", better="", format="three decimals", table="energy"),
        MetricRow("furnace_colour", "in its own colours", better="", format="three decimals", table="energy"),
        # Aliasing.
        MetricRow(
            "flicker",
            "flicker",
            "Temporal variance of the receding plane's luminance while the cloth slides by less than a pixel a frame, "
            "minus the truth's own, over the truth's squared mean. 0 is the truth; below 0 the method shows less of "
            "the motion than there is. Random methods draw new points in every frame.",
            better="near 0",
            format="signed",
            table="aliasing",
        ),
        MetricRow("motion", "motion", better="", format="scientific", table="aliasing"),
        MetricRow(
            "excess_energy",
            "excess energy",
            "Power of the receding plane beyond half the Nyquist frequency (Hann window, mean over frames) minus the "
            "truth's, over the truth's squared mean. 0 is the truth.",
            better="near 0",
            format="signed",
            table="aliasing",
        ),
        MetricRow("spectrum", "spectrum", better="", format="scientific", table="aliasing"),
        # Time and storage.
        MetricRow(
            "time",
            "ns a query",
            "Median time of one query, everything included, of calls that take turns in one process after a warm-up; "
            "quartiles beside it. One call holds thousands of queries of every fabric, fewer of slow methods. On "
            "several threads each makes the whole call, as a renderer gives each of its threads a tile.",
            unit="ns/query",
            format="grouped",
            table="timing",
            of_machine=True,
        ),
        MetricRow("waited", "share of waiting", format="percent", table="timing", of_machine=True),
        MetricRow(
            "bytes_stored",
            "bytes stored",
            "Bytes that a renderer stores for one fabric: weights, textures and tables; mean over fabrics.",
            unit="B",
            format="bytes",
            table="timing",
        ),
        MetricRow(
            "peak_memory",
            "memory of a call",
            "Largest memory that a call on one thread adds to the process, answers included, beyond the bytes stored. "
            "Not of a GPU.",
            unit="B",
            format="bytes",
            table="timing",
            of_machine=True,
        ),
        MetricRow(
            "prepare_time",
            "ms to add a fabric",
            "Median time until a new fabric, or one with edited yarns, can be queried; nothing else delays the "
            "queries. None where every fabric is trained by itself.",
            unit="ms",
            table="timing",
            of_machine=True,
        ),
        MetricRow("not_run", "not run", better="", table="timing", of_machine=True),
        # By the size of footprints.
        MetricRow("size_colour", "colour, by size", format="percent", table="by_size"),
        MetricRow("size_specular", "specular, by size", format="percent", table="by_size"),
        MetricRow("size_diffuse", "diffuse, by size", format="percent", table="by_size"),
        MetricRow(
            "size_time", "ns a query, by size", unit="ns/query", format="grouped", table="by_size", of_machine=True
        ),
        # Between fabrics.
        MetricRow("path_error", "latents blended", format="percent", table="between"),
        MetricRow("reencode_error", "encoded anew", format="percent", table="between"),
        MetricRow("encode_time", "time of an edit", unit="ms", table="between", of_machine=True),
        # Silhouettes.
        MetricRow("silhouette_coverage", "coverage, RMSE", format="three decimals", table="silhouettes"),
        MetricRow(
            "silhouette_displacement",
            "edge too far out, yarn spacings",
            unit="yarn spacings",
            better="near 0",
            format="signed",
            table="silhouettes",
        ),
        MetricRow("silhouette_light", "light, RMSE", format="three decimals", table="silhouettes"),
        # Pictures of scenes.
        MetricRow("mse_relative", "relative MSE", format="scientific", table="scenes"),
        MetricRow("mse_relative_floor", "relative MSE of the noise", better="", format="scientific", table="scenes"),
        MetricRow(
            "psnr",
            "PSNR",
            "Peak signal-to-noise ratio of a scene's first frame as it is shown (times the exposure, cut at 1, sRGB "
            "codes): 10 log10 of 1 over the mean squared difference of lit pixels, in dB. Higher is better.",
            unit="dB",
            better="higher",
            format="one decimal",
            table="scenes",
        ),
        MetricRow("psnr_floor", "PSNR of the noise", unit="dB", better="", format="one decimal", table="scenes"),
        MetricRow(
            "ssim",
            "SSIM",
            "Structural similarity of the same codes, Gaussian window, mean over channels and lit pixels. 1 is equal.",
            better="higher",
            format="three decimals",
            table="scenes",
        ),
        MetricRow("ssim_floor", "SSIM of the noise", better="", format="three decimals", table="scenes"),
        MetricRow(
            "flip_ldr",
            "FLIP",
            "Mean of the error map that NVIDIA's FLIP makes of the same codes: how different two pictures look to a "
            "viewer who flips between them on a screen. 0 is equal, 1 as different as can be.",
            format="three decimals",
            table="scenes",
        ),
        MetricRow("flip_ldr_floor", "FLIP of the noise", better="", format="three decimals", table="scenes"),
        MetricRow(
            "flip_hdr",
            "HDR-FLIP",
            "The same of linear light, over all exposures between those that fit the median and the brightest pixel.",
            format="three decimals",
            table="scenes",
        ),
        MetricRow("flip_hdr_floor", "HDR-FLIP of the noise", better="", format="three decimals", table="scenes"),
        MetricRow(
            "delta_e",
            "ΔE",
            "Mean difference of colour by CIEDE2000, of linear light cut at 1. About 1 can just be seen side by side.",
            format="two decimals",
            table="scenes",
        ),
        MetricRow("delta_e_floor", "ΔE of the noise", better="", format="two decimals", table="scenes"),
        MetricRow(
            "fovvideovdp",
            "FovVideoVDP",
            "How visible the differences of the frames are on a display, flicker included, in just-objectionable "
            "differences (JOD): 10 is no visible difference. Shown where it was installed.",
            unit="JOD",
            better="higher",
            format="two decimals",
            table="scenes",
        ),
        MetricRow(
            "fallback_share",
            "fallback share",
            "Share of a scene's queries out of the domain of a method (light or a viewer behind the cloth, cloth "
            "outside the range of its training), which the fallback answers: a node table.",
            better="",
            format="whole percent",
            table="scenes",
        ),
        MetricRow(
            "frame_time",
            "ms a frame",
            "Of a scene, the time of its first frame; elsewhere the time of 1920 × 1080 queries, one a pixel.",
            unit="ms/frame",
            table="scenes",
            of_machine=True,
        ),
        # Extremes of methods.
        MetricRow("extreme_error", "error by footprint", format="percent", table="extremes"),
        MetricRow("extreme_grazing", "error at grazing angles", format="percent", table="extremes"),
        MetricRow("extreme_rounding", "difference from single precision", format="scientific", table="extremes"),
        MetricRow("extreme_far", "difference far away", format="scientific", table="extremes"),
        MetricRow("extreme_large", "difference of large footprints", format="scientific", table="extremes"),
        MetricRow("extreme_not_finite", "not finite", format="grouped", table="extremes"),
        MetricRow("extreme_negative", "negative", format="grouped", table="extremes"),
        # The truth itself.
        MetricRow("worst_error", "worst error", format="scientific", table="stability"),
        MetricRow("listed_error", "limit", better="", format="scientific", table="stability"),
        MetricRow("naive_error", "error of the textbook's formula", format="scientific", table="stability"),
        MetricRow("not_finite", "not finite", format="grouped", table="stability"),
        MetricRow("negative", "negative", format="grouped", table="stability"),
        MetricRow("naive_not_finite", "not finite by the textbook's", format="grouped", table="stability"),
        MetricRow("rate", "rate", better="higher", table="rates", of_machine=True),
        MetricRow("true_rmse", "RMSE", format="percent", table="truth_accuracy"),
        MetricRow("true_error", "median error", format="percent", table="truth_accuracy"),
        MetricRow("stated_error", "median stated error", format="percent", table="truth_accuracy"),
        MetricRow("points", "points a query", unit="points/query", format="grouped", table="truth_accuracy"),
        MetricRow(
            "query_rate",
            "queries a second",
            unit="queries/s",
            better="higher",
            format="grouped",
            table="truth_accuracy",
            of_machine=True,
        ),
        MetricRow("points_saved", "fewer points", better="higher", table="truth_accuracy"),
        MetricRow("reference_error", "error of the reference", format="percent", table="truth_accuracy"),
        MetricRow("error_ratio", "true over standard error", better="", table="truth_calibration"),
        MetricRow("bound_exceeded", "errors beyond their bound", format="percent", table="truth_calibration"),
        MetricRow(
            "error_ratio_through",
            "true over standard error, transparency",
            better="",
            table="truth_calibration",
        ),
        MetricRow(
            "bound_exceeded_through",
            "errors beyond their bound, transparency",
            format="percent",
            table="truth_calibration",
        ),
        MetricRow("bias", "bias", better="near 0", format="percent", table="truth_bias"),
        MetricRow("colour_loss", "loss by mean colours", format="percent", table="truth_colours"),
        MetricRow("colour_bias", "bias of mean colours", better="near 0", format="percent", table="truth_colours"),
        MetricRow("mean_colours_time", "time of mean colours", unit="s/query", table="truth_colours", of_machine=True),
        MetricRow(
            "exact_colours_time", "time of exact colours", unit="s/query", table="truth_colours", of_machine=True
        ),
        MetricRow("kind_share", "share of the queries", better="", format="percent", table="truth_effort"),
        MetricRow("kind_points", "points a query", unit="points/query", format="grouped", table="truth_effort"),
        MetricRow("kind_time", "time of a query", unit="s/query", table="truth_effort", of_machine=True),
        MetricRow("variance_saved", "variance of the cosine over its own", better="higher", table="sampler"),
        MetricRow(
            "saved_in_time",
            "variance x time of the cosine over its own",
            better="higher",
            table="sampler",
            of_machine=True,
        ),
        MetricRow(
            "sample_time", "ns a direction", unit="ns/direction", format="grouped", table="sampler", of_machine=True
        ),
        MetricRow(
            "estimate_time",
            "ns a direction with its value",
            unit="ns/direction",
            format="grouped",
            table="sampler",
            of_machine=True,
        ),
        # Path-traced frames in Mitsuba.
        MetricRow(
            "traced_error",
            "error of a path-traced frame",
            "Mean squared error of linear RGB over a frame in Mitsuba, over the squared mean of the frame; the setting "
            "is the samples a pixel.",
            format="scientific",
            table="traced",
        ),
        MetricRow(
            "traced_time",
            "time of a path-traced frame",
            "Seconds of one processor for that frame.",
            unit="s/frame",
            table="traced",
            of_machine=True,
        ),
        MetricRow(
            "traced_gain",
            "× lower than one point in equal time",
            "Error of frames with one random point a sample in equal time over this error.",
            better="higher",
            table="traced",
            of_machine=True,
        ),
    )
}
"""All metrics by name."""


def metric_row(metric: str) -> MetricRow:
    """Return the row of a metric; one from outside that was not entered (`enter`) has little more than its name.

    Raises
    ------
    KeyError
        If there is no such metric.
    """
    if metric not in METRICS and metric.startswith(ADDED):
        return MetricRow(metric, metric.removeprefix(ADDED).replace("_", " "))
    return METRICS[metric]


def enter(row: MetricRow) -> None:
    """Enter a metric from outside in this process."""
    METRICS[row.name] = row
