import numpy as np
import pytest

from pipeline.fingerprint import fingerprint
from pipeline.scenes.shade import compose, shade
from pipeline.scenes.views import view
from reports.images.exr import RGB, read_exr
from reports.measure.pictures import ERROR, render_method, render_truth
from weaves.fabric import load_fabric


@pytest.fixture(scope="module")
def truth(tmp_path_factory, options):
    path = tmp_path_factory.mktemp("pictures") / "truth.exr"
    render_truth(load_fabric("denim"), "sphere", options, path)
    return path


def test_truth_is_lit_where_the_view_is_and_pictures_repeat_to_the_byte(truth, options, tmp_path):
    gbuffer = view("sphere", *options.sphere_size, options=options.view)
    exr = read_exr(truth)
    assert (exr.channels["A"] == gbuffer.mask).all()
    picture, error = exr.stack(*RGB), exr.stack(*ERROR)
    assert (picture[gbuffer.lit].max(axis=1) > 0).all() and (picture[~gbuffer.lit] == 0).all()
    assert np.median(error[gbuffer.lit] / picture[gbuffer.lit]) < 0.2 and exr.attributes["fabric"] == "denim"
    assert exr.attributes["method"] == "truth"
    render_truth(load_fabric("denim"), "sphere", options, tmp_path / "again.exr")
    assert (tmp_path / "again.exr").read_bytes() == truth.read_bytes()


def test_mse_is_that_of_the_pictures(truth, options, points, tmp_path):
    """Oracle: the mean square of the difference of the two files over lit pixels, less the noise in the truth's."""
    denim, gbuffer = load_fabric("denim"), view("sphere", *options.sphere_size, options=options.view)
    records, lit = render_method(points[0], denim, "sphere", options, truth, tmp_path / "points.exr"), gbuffer.lit
    shown, reference = read_exr(tmp_path / "points.exr"), read_exr(truth)
    queries, seed = gbuffer.queries(denim.repeat), int(fingerprint(["picture", "denim", "sphere", options.seed]), 16)
    own = compose(gbuffer, shade(denim, points[0].predict(denim, queries, seed), queries))
    np.testing.assert_allclose(shown.stack(*RGB), own, rtol=1e-6)
    measured = np.square(shown.stack(*RGB)[lit].astype(np.float64) - reference.stack(*RGB)[lit]).mean()
    noise = np.square(reference.stack(*ERROR)[lit].astype(np.float64)).mean()
    found = {record.metric: record.value for record in records}
    assert found == pytest.approx({"mse": measured - noise, "mse_measured": measured, "truth_noise": noise}, rel=1e-5)
    assert {record.scene for record in records} == {"sphere"} and shown.attributes["setting"] == "k = 1"
