"""Small sets of extra rows, one of each kind."""

from pipeline.shards.angular_samples import AngularSamples
from pipeline.shards.silhouettes import SilhouetteRows
from pipeline.truth.options import TruthOptions

COARSE = TruthOptions(relative_error=0.2, min_count=32, max_count=64)
_TEXELS = {"texels_per_yarn": 2, "texel_sigma": 0.5, "samples": 4, "max_angle": 89.0}
SAMPLES = AngularSamples(**_TEXELS, directions="projected_disc", truth=COARSE)
_ROWS = {"rows": 512, "sigma": (0.5, 8.0), "largest_curvature": 0.5, "anywhere": 0.1}
_ROWS |= {"footprint": "gaussian", "seed": 0}
OPACITY, GRAZING = (SilhouetteRows(kind=k, points=n, **_ROWS) for k, n in (("opacity", 32), ("grazing_cosine", 1024)))
