"""Small sets of extra rows, one of each kind."""

from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.silhouettes import SilhouetteRows
from pipeline.truth.options import TruthOptions

COARSE = TruthOptions(relative_error=0.2, min_count=32, max_count=64)
SAMPLES = AngularSamples(
    texels_per_yarn=2, texel_sigma=0.5, samples=4, directions="projected_disc", max_angle=89.0, truth=COARSE
)
OPACITY = SilhouetteRows(
    kind="opacity", rows=512, points=32, sigma=(0.5, 8.0), largest_curvature=0.5, anywhere=0.1, footprint="gaussian",
    seed=0,
)  # fmt: skip
GRAZING = OPACITY.model_copy(update={"kind": "grazing_cosine", "points": 1024})
