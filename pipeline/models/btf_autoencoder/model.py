"""An autoencoder of one fabric's bidirectional texture [Rainer2019Neural]: `unified_btf` with a latent of 8.

One network for each fabric, so that eight numbers a texel are enough; with 3 outputs the decoder has the published
35,725 weights. ADAPTED: the encoder is that of 2020, which reads any number of samples, and so are values and loss.
"""

from pipeline.models.unified_btf.model import build, restore

__all__ = ["build", "restore"]
