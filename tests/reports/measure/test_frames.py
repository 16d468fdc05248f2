import pytest

from reports.images.exr import read_exr
from reports.measure.frames import measure_aliasing, measure_truth_frames, render_frames
from weaves.fabric import load_fabric


@pytest.fixture(scope="module")
def frames(tmp_path_factory, options):
    path = tmp_path_factory.mktemp("frames") / "denim.exr"
    render_frames(load_fabric("denim"), options, path)
    return path


def test_frames_move_one_below_the_other_and_their_truth_has_the_motions_variance(frames, options):
    width, height = options.frame_size
    plane = read_exr(frames).channels["Y"]
    assert plane.shape == (3 * height, width)
    first, second = plane[:height], plane[height : 2 * height]
    assert (first[-1] > 0).all() and (first != second).any()
    motion, spectrum = measure_truth_frames(load_fabric("denim"), options, frames)
    assert (motion.metric, spectrum.metric) == ("motion", "spectrum") and 0 < motion.value < 0.2
    frequency = [k for k, _ in spectrum.curve]
    assert frequency == sorted(frequency) and 0 < frequency[0] < frequency[-1] < 0.5


def test_point_sampling_aliases_and_the_truth_does_not(frames, options, points, oracle):
    """Rationale: a second draw of the truth differs from the first by noise alone, which is subtracted.

    Points are independent in every frame and pixel: their variance shows in both figures, less with more points.
    """
    denim = load_fabric("denim")

    def measured(method):
        return {r.metric: r.value for r in measure_aliasing(method, denim, options, frames)}

    one, _, sixteen = (measured(method) for method in points)
    own = measured(oracle)
    for metric in ("flicker", "excess_energy"):
        assert one[metric] > 4 * sixteen[metric] > 0 and abs(own[metric]) < 0.1 * sixteen[metric]
