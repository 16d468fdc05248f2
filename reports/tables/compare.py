"""Which differences between two benchmarks are real.

Times are compared by their raw samples with the test of Mann and Whitney [Mann1947Test]: no distribution is assumed,
and a few slow calls do not matter. It takes readings to be independent; what was different on the machine while the two
benchmarks ran, its clock or other work, is a difference too: under changing load the same code was marked 1.4 times
slower than itself, so that two runs of A belong before one of B (how busy the machine was stands beside the times:
`reports.tables.sentences`). Mean squared errors are compared by
z = (b - a) / sqrt(s_a^2 + s_b^2) with their standard errors; where both were measured on the same queries these are not
independent, and the test is the stricter for it. All p-values of a comparison are corrected together
[Holm1979Simple]: the chance that the readings' own scatter marks any difference is at most `LEVEL`.

The error of a network that was trained several times is the mean over trainings (`reports.over_seeds`). A difference
of such errors counts only if it exceeds both: the interval over queries, by the test above, and the range over
trainings, the larger of A's and B's. Of equal, normal trainings, three in A and three in B, a difference exceeds the
range in 5 of 100 comparisons; of two and two in 22, of one and three in 24, of five and five in .2. One training in A
and one in B have no range: there the test says nothing of other trainings.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Final, Literal, NamedTuple

from scipy import stats

from reports.over_seeds import over_trainings, trainings
from reports.record import Machine, Metric, Record
from reports.tables.number_format import NONE, display
from reports.tables.table import ResultTable, TableCell, TableRow
from weaves.errors import BadInput

LEVEL: Final = 0.05  # chance that a comparison marks any difference where there is none
TIMES: Final[tuple[Metric, ...]] = ("time", "prepare_time", "encode_time")  # metrics that are compared by their samples

Outcome = Literal["faster", "slower", "lower", "higher", "no difference shown", "within trainings", "not tested"]

NO_DIFFERENCE: Final[tuple[Outcome, ...]] = ("no difference shown", "within trainings", "not tested")
"""Outcomes that mark no difference."""

_Key = tuple[Metric, str, str, str, int, str]


class Difference(NamedTuple):
    """One measurement in both benchmarks."""

    a: Record
    b: Record
    sign: float  # above 0 if B is the larger: by ranks for times
    p: float
    """Probability of a difference at least as large by chance, corrected for all rows; NaN if it cannot be tested."""
    extent: float = math.nan  # range over trainings, the larger of A's and B's; NaN where neither has several

    @property
    def ratio(self) -> float:
        """B over A; NaN where A is not positive."""
        return self.b.value / self.a.value if self.a.value > 0 else math.nan

    @property
    def result(self) -> Outcome:
        """Result of the test of B against A."""
        if math.isnan(self.p):
            return "not tested"
        if self.p > LEVEL:
            return "no difference shown"
        if abs(self.b.value - self.a.value) <= self.extent:
            return "within trainings"
        words: tuple[Outcome, Outcome] = ("faster", "slower") if self.a.metric in TIMES else ("lower", "higher")
        return words[self.sign > 0]


class Comparison(NamedTuple):
    """All that two benchmarks share, and what they do not."""

    times: list[Difference]
    errors: list[Difference]
    only_a: int  # measurements that A alone has, of those that can be compared
    only_b: int
    unlike: list[str]  # other differences that can affect the numbers: data sets, versions


def refuse_other_machine(a: Machine, b: Machine, allow: bool = False) -> list[str]:
    """Refuse measurements of different machines, or say in a sentence what differs if they are allowed.

    BadInput names the first thing that differs.
    """
    for name in ("cpu", "cores", "threads"):
        first, second = getattr(a, name), getattr(b, name)
        if first != second and not allow:
            allowed = f"A was measured with {first!r}; times of two machines are compared with --other-machine only"
            raise BadInput("compare", f"{name} of B", second, allowed)
        if first != second:
            return [f"A and B were measured on different machines: {name} {first} and {second}"]
    return []


def compare(a: Sequence[Record], b: Sequence[Record]) -> Comparison:
    """Compare two benchmarks, measurement by measurement; BadInput if they share none.

    Measurements of the same metric, method, setting, fabric, number of threads and edit are compared: times (`TIMES`),
    those of unseen fabrics apart, and the MSE on held-out queries, the mean over trainings. Of several that are alike
    the last counts.
    """
    first, second = (_comparable(over_trainings(records)) for records in (a, b))
    extents = _extents(a, b)
    shared = [key for key in first if key in second]
    if not shared:
        raise BadInput("compare", "", "A and B share no measurement", "times or errors of the same methods are needed")
    tests = [_test(first[key], second[key]) for key in shared]
    rows = [
        Difference(first[key], second[key], sign, p, extents.get(key, math.nan))
        for key, (sign, _), p in zip(shared, tests, holm([p for _, p in tests]), strict=True)
    ]
    times, errors = ([row for row in rows if (row.a.metric in TIMES) == of_times] for of_times in (True, False))
    return Comparison(times, errors, len(first) - len(shared), len(second) - len(shared), _unlike(rows))


def difference_tables(comparison: Comparison) -> list[ResultTable]:
    """Return the differences of times and of errors as tables; what differs is marked."""
    return [
        ResultTable(title, ("method", "of", "A", "B", "B / A", "p", "result"), tuple(map(_row, differences)))
        for title, differences in (("Times", comparison.times), ("MSE, 95 % interval", comparison.errors))
        if differences
    ]


def _row(row: Difference) -> TableRow:
    p = "" if math.isnan(row.p) else f"{row.p:.2g}" if row.p >= 1e-3 else "< .001"
    ratio = NONE if math.isnan(row.ratio) else f"{row.ratio:.3g}"
    words = (_subject(row.a), _value(row.a), _value(row.b), ratio, p, row.result)
    kind = "" if row.result in NO_DIFFERENCE else "marked"
    return TableRow(display(row.a.method, row.a.setting), tuple(map(TableCell, words)), kind=kind)


def _subject(record: Record) -> str:
    if record.metric == "time":
        query = "a query of unseen fabrics" if record.role else "a query"
        return f"{query}, {record.threads} thread{'' if record.threads == 1 else 's'}" if record.threads else query
    words = {"prepare_time": "to add a fabric", "encode_time": f"to edit {record.note}"}
    return words.get(record.metric, record.fabric)


def _value(record: Record) -> str:
    """Return a time with its unit, or an error with half its 95 % interval."""
    if record.unit != "1":
        return f"{record.value:,.4g} {record.unit.split('/')[0]}"
    half = "" if record.standard_error is None else f" ± {1.96 * record.standard_error:.1e}"
    return f"{record.value:.2e}{half}"


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values corrected for their number, so that the least is multiplied by it, the next by one less.

    p'_(i) = max over j <= i of min(1, (m - j + 1) p_(j)) [Holm1979Simple]; NaN stays NaN and does not count.
    """
    order = sorted((index for index, p in enumerate(p_values) if not math.isnan(p)), key=lambda index: p_values[index])
    result, largest = [math.nan] * len(p_values), 0.0
    for rank, index in enumerate(order):
        largest = max(largest, min(1.0, (len(order) - rank) * p_values[index]))
        result[index] = largest
    return result


def _comparable(records: Iterable[Record]) -> dict[_Key, Record]:
    """Return times and errors by what they are of."""
    chosen = (r for r in records if r.metric in TIMES or (r.metric == "mse" and r.scene == "queries"))
    parts = ((r, {"encode_time": r.note, "time": r.role}.get(r.metric, "")) for r in chosen)
    return {(r.metric, r.method, r.setting, r.fabric, r.threads, part): r for r, part in parts}


def _extents(*benchmarks: Sequence[Record]) -> dict[_Key, float]:
    """Return the range of each number over trainings, the largest of all benchmarks that have several."""
    extents: dict[_Key, float] = {}
    for records in benchmarks:
        counts = trainings(records)
        least, most = (_comparable(over_trainings(records, ends)) for ends in (min, max))
        for key, record in most.items():
            if counts[record.method, record.setting] > 1:
                extents[key] = max(extents.get(key, 0.0), record.value - least[key].value)
    return extents


def _test(a: Record, b: Record) -> tuple[float, float]:
    """Return which is larger, and the two-sided p-value: NaN without samples or standard errors."""
    gap = b.value - a.value
    if a.metric in TIMES:
        if not a.samples or not b.samples:
            return gap, math.nan
        test = stats.mannwhitneyu(b.samples, a.samples, alternative="two-sided")
        return float(test.statistic) - 0.5 * len(a.samples) * len(b.samples), float(test.pvalue)
    if a.standard_error is None or b.standard_error is None:
        return gap, math.nan
    spread = math.hypot(a.standard_error, b.standard_error)
    return gap, float(2.0 * stats.norm.sf(abs(gap) / spread)) if spread else float(gap == 0)


def _unlike(rows: Sequence[Difference]) -> list[str]:
    sentences = []
    if any(row.a.provenance.dataset != row.b.provenance.dataset for row in rows):
        sentences.append("A and B were measured on different data sets")
    if any(row.a.provenance.version != row.b.provenance.version for row in rows):
        sentences.append("A and B were measured by different versions of the benchmark")
    once = [row.a for row in rows if math.isnan(row.extent) and row.a.metric not in TIMES]
    if names := ", ".join(dict.fromkeys(record.method for record in once if record.provenance.model)):
        sentences.append(f"one training in A and B: another training of {names} may differ by more than is marked here")
    if methods := [row.a.method for row in rows if row.a.metric == "time" and row.a.note != row.b.note]:
        sentences.append(f"calls of different sizes were timed: {', '.join(dict.fromkeys(methods))}")
    return sentences
