import numpy as np
import pytest

from pipeline.models.unified_btf import UnifiedBtfOptions
from pipeline.truth.options import TruthOptions
from reports.measure import encodings
from reports.measure.encodings import evenly, measure_encodings
from weaves.fabric import load_fabric

pytestmark = pytest.mark.usefixtures("coarse_truth")

OPTIONS = UnifiedBtfOptions(texels_per_yarn=2, texel_sigma=1.0, max_angle=60.0)


class Mean:
    """Knows of a texel the mean of its samples, and answers that under all directions."""

    name, options = "mean", OPTIONS

    def encode(self, wi, wo, values):
        return values.mean(axis=0)

    def decode(self, latents, wi, wo):
        return np.broadcast_to(latents, (len(wi), *latents.shape))


def test_errors_fall_with_the_samples_and_rise_with_noise_and_means_of_means_are_means(monkeypatch):
    """The mean is linear: averaged or blended latents are those of averaged or blended samples, to the last bits."""
    monkeypatch.setattr(encodings, "GIVEN", (5, 20, 80))
    monkeypatch.setattr(encodings, "_NOISY", 80)
    fabrics = (load_fabric(name) for name in ("polyester_lining", "denim"))
    records = measure_encodings(Mean(), *fabrics, TruthOptions(estimator="node_table"))
    curves = {record.note: np.array(record.curve) for record in records}
    assert len(curves) == len(records) == 8
    assert all(record.value == record.curve[-1][1] and record.method == "mean" for record in records)
    means, read = curves["random samples"], curves["interpolation of samples"]
    assert list(means[:, 0]) == [5, 20, 80] == list(read[:, 0])
    assert means[0, 1] > means[2, 1] > 0.1 and read[0, 1] > read[2, 1] and read[2, 1] < means[2, 1]
    noise = curves["noise of 80 samples"]
    assert noise[0, 1] == pytest.approx(means[2, 1]) and noise[-1, 1] > noise[0, 1]
    for averaged, own in (
        ("averaged latents", "latents of averaged samples"),
        ("latents blended with those of denim", "latents of samples blended with denim"),
    ):
        np.testing.assert_allclose(curves[averaged], curves[own], rtol=1e-4)
    assert [width for width, _ in curves["averaged latents"]] == [1, 2, 4]
    directions = evenly(200, 60.0, 0.0)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-6)
    assert directions[:, 2].min() > 0.49 and abs(np.mean(1 - directions[:, 2] ** 2) - 0.75 / 2) < 0.01
