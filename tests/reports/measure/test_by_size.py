"""Errors and times by the size of footprints: each class by itself."""

from reports.measure.by_size import EDGES, MEASURES, SIZES, measure_errors_by_size, measure_times_by_size


def test_errors_are_those_of_the_class_alone(dataset, points, options):
    manifest, folder = dataset
    errors = measure_errors_by_size(points, manifest, folder, options.seed)
    times = measure_times_by_size(points, manifest, folder, options)
    assert len(SIZES) == len(EDGES) - 1
    by = {(r.metric, r.setting): r for r in (*errors, *times)}
    assert {r.metric for r in errors} == {metric for metric, _ in MEASURES.values()}
    # More points, less error, in every class; a query of 16 points takes longer than one of 1.
    few, many = by["size_colour", "k = 1"], by["size_colour", "k = 16"]
    assert all(a > b for (_, a), (_, b) in zip(few.curve, many.curve, strict=True))
    time = by["size_time", "k = 1"]
    assert (
        time.value > 0 and time.count == few.count and {low for low, _ in time.curve} == {low for low, _ in few.curve}
    )
    # The whole lies between its classes.
    values = [value for _, value in few.curve]
    assert min(values) <= few.value <= max(values)
    assert {low for low, _ in few.curve} <= set(EDGES[:-1])
