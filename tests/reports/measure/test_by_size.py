from reports.measure.by_size import EDGES, MEASURES, SIZES, measure_by_size, measure_errors_by_size


def test_errors_are_those_of_the_class_alone(dataset, points, options):
    found = measure_by_size(points, dataset, options)
    assert len(SIZES) == len(EDGES) - 1
    by = {(r.metric, r.setting): r for r in found}
    assert {r.metric for r in found} == {"size_time", *(metric for metric, _ in MEASURES.values())}
    # More points, less error, in every class; a query of 16 points takes longer than one of 1.
    few, many = by["size_colour", "k = 1"], by["size_colour", "k = 16"]
    assert all(a > b for (_, a), (_, b) in zip(few.curve, many.curve, strict=True))
    assert by["size_time", "k = 1"].value > 0
    # The whole lies between its classes.
    values = [value for _, value in few.curve]
    assert min(values) <= few.value <= max(values) and {low for low, _ in few.curve} <= set(EDGES[:-1])
    # Errors alone are the same numbers.
    alone = measure_errors_by_size(points, dataset, options.seed)
    assert alone == [record for record in found if record.metric != "size_time"]
