"""A neural material for curved surfaces: reflectance with the curvature as an input, and opacity [Kuznetsov2022Curved].

Cloth on a curved surface lies wholly below its boundary. A camera ray enters the boundary, and may leave it again
without a hit: that share is missed, and it makes the silhouette. Three modules, each a texture over the
repeat and a perceptron; the first two do not know the light:

    opacity       texture 7 + wo + kappa -> 24 -> 24 -> 24 -> 1, through a sigmoid
    offset        texture 7 + wo + kappa -> 24 -> 24 -> 24 -> 1, which shifts the centre along the view
    reflectance   texture 7 at the shifted centre + wi + wo + kappa -> 24 -> 24 -> 24 -> 4

`silhouette = "grazing"` predicts the cosine at which a ray just touches the cloth in place of the opacity, which is a
step in it. Over a footprint that cosine has a distribution: its mean and deviation are learnt, in units of
sqrt(kappa), from `pipeline.truth.geometry.opacity.grazing_cosine`, and the opacity is that Gaussian's share below wo.z.
For that variant gaps count as filled, as they do in its truth.

A row's transparency is another quantity: the share of light that goes straight through the cloth at the points that the
viewer sees. So the silhouette is learnt from rows of its own (pipeline.shards.silhouettes). ADAPTED as in `neumip`:
four components, specular ones in log space, counts of texels and steps. The paper has one level and no footprint:
`levels = 1` with `curvature_input = "linear"` is nearest to it.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.compiled.arrays import Float32
from pipeline.models.curved import CurvedOptions
from pipeline.models.network import Batch, NetworkMethod, Trained, restored
from pipeline.models.networks.layers import component_error, once_a_place, perceptron, to_components
from pipeline.models.networks.texture import LAYERS, TextureNetwork, level_shapes, random_pyramid
from pipeline.truth.cloth import cloth_side
from pipeline.truth.geometry.heightfield import has_gaps
from pipeline.truth.options import TruthOptions
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

SHARPEST: Final = 0.02  # least deviation of the grazing cosine, in units of sqrt(kappa): no step can be learnt
_NO_FALL = -1.0  # finite, because weights are averaged


class View(NamedTuple):
    """Footprints, viewers and curvatures of n queries."""

    u: Tensor
    v: Tensor
    """Centres, in repeats, (n,)."""
    sigma: Tensor  # footprints, in yarn spacings, (n,)
    wo: Tensor  # to the viewer, (n, 3)
    curvature: Tensor  # in the viewer's plane, 1/yarn spacings, (n,)


class SilhouetteData(nn.Module):
    """Queries about the silhouette and their answers; no part of a trained model.

    `columns` are rows of kind `opacity` or `grazing_cosine` (`pipeline.shards.silhouettes`), `repeat` is ends and
    picks. Targets (n, 2) are opacity and 0, or mean and variance of the grazing cosine, over sqrt(kappa) and kappa.
    """

    def __init__(self, columns: Mapping[str, npt.NDArray[Any]], repeat: tuple[int, int]) -> None:
        super().__init__()
        ends, picks = repeat
        wo = np.stack([columns["wo_x"], columns["wo_y"], columns["wo_z"]], axis=-1)
        if "opacity" in columns:
            target = [columns["opacity"], np.zeros_like(columns["opacity"])]
        else:
            target = [columns["grazing_mean"], columns["grazing_variance"]]
        view = (columns["u"] / ends, columns["v"] / picks, columns["sigma"], wo, columns["curvature"])
        for name, column in zip((*View._fields, "target"), (*view, np.stack(target, axis=-1)), strict=True):
            self.register_buffer(name, torch.from_numpy(np.array(column, np.float32)), persistent=False)

    def draw(self, count: int, random: np.random.Generator) -> tuple[View, Tensor]:
        """Return `count` random queries and their answers."""
        rows = torch.from_numpy(random.integers(0, len(self.get_buffer("u")), count)).to(self.get_buffer("u").device)
        return View(*(self.get_buffer(name)[rows] for name in View._fields)), self.get_buffer("target")[rows]


class CurvedNetwork(TextureNetwork):
    """Textures and perceptrons of one fabric.

    `silhouettes` are training rows of the opacity, needed for training only; `fall` is the depth below the boundary
    that every ray hits, in yarn spacings, negative if there is none, as with gaps.
    """

    textures: ClassVar[tuple[str, ...]] = ("opacity_levels", "depth", "levels")
    columns: ClassVar[tuple[str, ...]] = (*View._fields, "wi")
    options: CurvedOptions
    fall: Tensor

    def __init__(
        self,
        options: CurvedOptions,
        repeat: tuple[int, int],
        silhouettes: SilhouetteData | None = None,
        fall: float = _NO_FALL,
    ) -> None:
        super().__init__(options, repeat)
        self.silhouettes = silhouettes
        self.register_buffer("fall", torch.tensor(fall, dtype=torch.float32))
        view, light = _axes(options) + (2 if options.curvature_input == "touch" else 1), _axes(options)
        coarse = level_shapes(options.silhouette_texels_per_yarn, options.levels, repeat)
        self.opacity_levels = random_pyramid(options.channels, coarse)
        outputs = 2 if options.silhouette == "grazing" else 1
        self.opacity = perceptron(options.channels + view, options.hidden, LAYERS, outputs)
        self.create_reflectance(view, light)

    def forward(self, view: View, wi: Tensor) -> Tensor:
        """Answer in network space, (n, 4), for light from wi (n, 3)."""
        features = once_a_place(lambda *columns: self._features(View(*columns)), *view)
        output: Tensor = self.decoder(torch.cat([features, wi[:, : _axes(self.options)]], dim=-1))
        return output

    def components(self, *inputs: Tensor) -> Tensor:
        """Return the components (n, 4) of the reflectance, without the opacity."""
        return to_components(self(View(*inputs[:-1]), inputs[-1]), self.options.log_k)

    def cover(self, view: View) -> Tensor:
        """Return the opacity in [0, 1], (n,)."""
        if self.options.silhouette == "grazing":
            mean, deviation = self.grazing(view)
            unit = view.curvature.sqrt().clamp_min(1e-6)  # on flat cloth every ray sinks: 1
            share: Tensor = torch.special.ndtr((view.wo[:, 2] / unit - mean) / deviation)
        else:
            share = torch.sigmoid(self._silhouette(view)[:, 0])
        # A ray so steep that it sinks below every yarn has hit one: tan^2 >= 2 kappa fall.
        cosine = view.wo[:, 2].square()
        sinks = cosine >= 2.0 * view.curvature * self.fall * (1.0 - cosine)
        return torch.where(sinks & (self.fall >= 0.0), torch.ones_like(share), share)

    def grazing(self, view: View) -> tuple[Tensor, Tensor]:
        """Return mean and deviation (n,) of the cosine at which a ray just touches, in units of sqrt(kappa)."""
        mean, width = self._silhouette(view).unbind(dim=-1)
        return mean, SHARPEST + functional.softplus(width)

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the weighted squared error of the components, and the silhouette's own loss at random rows."""
        options = self.options
        ends, picks = self.repeat
        columns = (batch.u / ends, batch.v / picks, batch.sigma, batch.wo, batch.curvature)
        view = View(*(column.flatten(0, 1) for column in columns))
        error = component_error(self(view, batch.wi.flatten(0, 1)), batch.target.flatten(0, 1), options)
        if self.silhouettes is None:
            return error
        return error + options.silhouette_weight * self._edge_loss(*self.silhouettes.draw(len(view.u), random))

    def _edge_loss(self, view: View, target: Tensor) -> Tensor:
        """Cross entropy of opacities; or minus the log likelihood of grazing cosines, above the sharpest Gaussian's."""
        if self.options.silhouette == "opacity":
            return functional.binary_cross_entropy_with_logits(self._silhouette(view)[:, 0], target[:, 0])
        mean, deviation = self.grazing(view)
        square = (target[:, 0] - mean).square() + target[:, 1]
        return ((deviation / SHARPEST).log() + 0.5 * square / deviation.square()).mean()

    def _silhouette(self, view: View) -> Tensor:
        texels = self.options.silhouette_texels_per_yarn
        features = self.read(list(self.opacity_levels), view.u, view.v, view.sigma, texels)
        if self.options.silhouette == "grazing":
            # The edge lies in a direction, not at an angle: of the view its azimuth alone.
            level = functional.normalize(view.wo * view.wo.new_tensor([1.0, 1.0, 0.0]), dim=-1, eps=1e-6)
            view = view._replace(wo=level)
        output: Tensor = self.opacity(torch.cat([features, self._view(view)], dim=-1))
        return output

    def _features(self, view: View) -> Tensor:
        """Return the features of places, and the perceptron's inputs for viewer and curvature."""
        seen = self._view(view)
        u, v = self.moved(view.u, view.v, view.sigma, view.wo, seen)
        return torch.cat([self.read(list(self.levels), u, v, view.sigma), seen], dim=-1)

    def _view(self, view: View) -> Tensor:
        """Return the perceptrons' inputs for viewer and curvature."""
        options, curvature = self.options, view.curvature.unsqueeze(-1)
        seen = [view.wo[:, : _axes(options)], curvature if options.curvature_input == "linear" else curvature.sqrt()]
        if options.curvature_input == "touch":
            square = view.wo[:, 2:].square()
            seen.append((square / (square + 2.0 * curvature * (1.0 - square)).clamp_min(1e-12)).sqrt())
        return torch.cat(seen, dim=-1)


def _axes(options: CurvedOptions) -> int:
    return 3 if options.directions == "vector" else 2


class Curved(NetworkMethod[CurvedNetwork]):
    """Trained materials for curved surfaces, one network for each fabric."""

    def coverage(self, fabric: Fabric, looks: Queries) -> Float32:
        """Return the share of each footprint's view rays that do not leave the cloth again, float32 (N,).

        It is the opacity; for open cloth that is less, unless `silhouette = "grazing"`, which takes gaps for filled.
        """
        network = self.network_of(fabric)

        def cover(*inputs: Tensor) -> Tensor:
            return network.cover(View(*inputs[:-1])).unsqueeze(-1)

        return self.per_query(fabric).answered(looks, cover, 1)[:, 0]

    def refuse(self, queries: Queries) -> None:
        """Refuse queries of kinds not trained on, and those of cloth that bends more than any trained on."""
        super().refuse(queries)
        limit: float = self.options.largest_curvature
        if self.domain is not None:
            limit = min(limit, self.domain.queries.curvature[1])
        beyond = np.flatnonzero(queries.curvature > limit * (1.0 + 1e-6))
        if beyond.size:
            where, value = f"curvature[{beyond[0]}]", float(queries.curvature[beyond[0]])
            raise BadInput("queries", where, value, f"the model {self.name} was trained up to {limit:g} only")


def build(
    options: CurvedOptions, fabrics: Sequence[Fabric], silhouettes: Sequence[Mapping[str, npt.NDArray[Any]]]
) -> CurvedNetwork:
    """Return an untrained network with its rows about the silhouette; there must be exactly one fabric."""
    (fabric,), (columns,) = fabrics, silhouettes
    front = cloth_side(fabric, TruthOptions()).front
    fall = _NO_FALL if has_gaps(front) else float(front.highest - front.lowest)
    return CurvedNetwork(options, fabric.weave.repeat, SilhouetteData(columns, fabric.weave.repeat), fall)


def restore(options: CurvedOptions, trained: Trained) -> list[Curved]:
    """Return one method that holds all trained fabrics."""
    return [Curved(*restored(options, trained, lambda repeat: CurvedNetwork(options, repeat)))]
