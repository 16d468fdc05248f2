"""Soft nodes corrected by a residual perceptron: one network for all fabrics and scales.

`pipeline.analytic.soft_nodes` answers a query by the point model over tens of nodes with softened horizons, and reports
how much of the answer is uncertain. A narrow perceptron reads these numbers and puts out four factors, one for each
component:

    features 40 -> width -> width -> 4,   component = 2 sigmoid(x) times that of the soft nodes

A second, smaller network estimates the error of this answer, and of one by the finest soft nodes (`error_network`).
Within a wished error (`Adaptive`) each query gets the cheapest of three answers whose estimated error is small enough:

    1  soft nodes corrected by the network        estimated by the network
    2  the finest soft nodes                      estimated by the network
    3  the fallback, a node table or samples      not estimated: the answer of what is left, with rims

Errors are root mean squares over many queries, relative to a grey cloth's colour: single errors may be larger. Light
from behind has no estimate; the finest soft nodes answer it, and all that the network is not trained for.

Factors lie between 0 and 2 and begin at 1: an untrained network is the soft nodes, and colours, highlights and the
repeat of a cloth need not be learnt. With `bound` no component exceeds the soft nodes' answer without shadows of the
light, and diffuse light returns at most what arrives (pipeline.analytic.soft_nodes.features).

10 of the 40 features depend on the fabric alone and fold into a bias. Mirror images need not be learnt, because the
features are the same for both; the exchange of warp and weft is learnt by exchanging them in half of all steps.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import ClassVar, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor, nn
from torch.nn import functional

from pipeline.analytic.soft_nodes.features import (
    EXCHANGED,
    EXCHANGED_SIGN,
    FEATURES,
    OF_QUERY,
    cloth_features,
    read_queries,
)
from pipeline.analytic.soft_nodes.nodes import SoftNodeTable, tabulate
from pipeline.compiled.arrays import Float32, nbytes
from pipeline.models.analytic.soft_nodes import SoftNodes, soft_tables
from pipeline.models.domain import Domain
from pipeline.models.fallback import fallback_answers
from pipeline.models.method import CHUNK_ROWS, Around, refuse_other, row_by_row
from pipeline.models.network import Answering, Batch, Columns, PerQuery, Trainable, Trained, restored
from pipeline.models.networks.layers import SLOPE, LinearLayer
from pipeline.models.selvage import SelvageOptions
from pipeline.models.selvage.error_network import FINEST, FLOOR, OWN, ErrorNetwork, colour_weights
from pipeline.per_fabric import PerFabric
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.query import Queries
from weaves.errors import BadInput
from weaves.fabric import Fabric

LARGEST_FACTOR: Final = 2.0
"""Largest factor."""

_STREAM = 0x5E1F  # of the queries whose features are normalised to 0 and 1
_LEAST_SPREAD = 1e-3  # of a feature; one that never varies must not blow up
_ANY = Queries.round(u=[0.5], v=[0.5], sigma=[1.0], wi=[[0.6, 0.0, 0.8]], wo=[[0.0, 0.0, 1.0]])
_COMPONENTS = (1, 0, 3, 2)  # where components come from when x and y are exchanged
_WIDTHS = (FEATURES, 4, 4, 4)  # of what the nodes give of a row
_MOST_KEPT = 2**23  # rows whose sums over nodes a training keeps, 1.7 GB; it computes others anew at every epoch


class _Read(NamedTuple):
    """A batch as the network sees it: features, components and bounds (n, 4), those of the finest nodes, targets."""

    features: Tensor
    components: Tensor
    bounds: Tensor
    finest: Tensor
    target: Tensor

    def exchanged(self) -> _Read:
        """Return the batch with x and y, warp and weft exchanged."""
        sign = torch.from_numpy(EXCHANGED_SIGN).to(self.features.device)
        features, *others = self
        return _Read(features[:, EXCHANGED.tolist()] * sign, *(x[:, list(_COMPONENTS)] for x in others))


class SelvageNetwork(Trainable):
    """The correcting network, with the cloth it is trained on.

    Parameters
    ----------
    options : SelvageOptions
        The design.
    fabrics : sequence of Fabric
        Training fabrics, addressed by index in batches; none for inference.
    """

    def __init__(self, options: SelvageOptions, fabrics: Sequence[Fabric] = ()) -> None:
        super().__init__()
        self.options = options
        sizes = [FEATURES] + [options.width] * options.layers
        self.hidden = nn.ModuleList(nn.Linear(a, b) for a, b in itertools.pairwise(sizes))
        self.last = nn.Linear(options.width, 4)
        nn.init.zeros_(self.last.weight)
        nn.init.zeros_(self.last.bias)
        self.mean: Tensor
        self.scale: Tensor
        self.register_buffer("mean", torch.zeros(FEATURES))
        self.register_buffer("scale", torch.ones(FEATURES))
        self.errors = ErrorNetwork(options, FEATURES)
        levels = (options.level, options.finest)
        tables = [[tabulate(fabric, level=level, rims=options.rims) for level in levels] for fabric in fabrics]
        self._tables, self._finest = [own for own, _ in tables], [finest for _, finest in tables]
        self.expect(0)
        if fabrics:
            self._measure(fabrics)

    def expect(self, rows: int) -> None:
        """Expect batches out of so many rows. Sums over nodes take longer than the rest of a step: they are kept."""
        rows = min(rows, _MOST_KEPT)
        self._kept, self._known = np.empty((rows, sum(_WIDTHS)), np.float32), np.zeros(rows, np.bool_)

    def forward(self, features: Tensor, components: Tensor, bounds: Tensor) -> Tensor:
        """Return components (n, 4) from features (n, FEATURES), and components and bounds (n, 4) of the soft nodes."""
        x = self._normalised(features)
        for layer in self.hidden:
            x = functional.leaky_relu(layer(x), SLOPE)
        factors: Tensor = LARGEST_FACTOR * torch.sigmoid(self.last(x))
        answer = components * factors
        return torch.minimum(answer, bounds) if self.options.bound else answer

    def loss(self, batch: Batch, random: np.random.Generator) -> Tensor:
        """Return the loss of the correction, and that of the estimated errors times its weight."""
        read = self._read(batch)
        if self.options.exchange and random.integers(2):
            read = read.exchanged()
        answer = self(read.features, read.components, read.bounds)
        colours = read.target.new_tensor(colour_weights(self.options))
        # The estimate teaches the correction nothing.
        with torch.no_grad():
            colour = answer @ colours
            both = torch.stack([colour, read.finest @ colours], dim=-1) - (read.target @ colours)[:, None]
            errors = both / (colour + FLOOR)[:, None]
        estimate = self.errors.loss(self._normalised(read.features), errors)
        return self.correction_loss(answer, read.target) + self.options.error_weight * estimate

    def correction_loss(self, answer: Tensor, target: Tensor) -> Tensor:
        """Return the squared errors of components and colour, over the colour: dark patches count too."""
        options, colours = self.options, target.new_tensor(colour_weights(self.options))
        error = (answer - target) * colours
        squared = error.square().sum(dim=-1) + options.colour_weight * error.sum(dim=-1).square()
        loss: Tensor = (squared / (target @ colours + options.dark)).mean()
        return loss

    def _normalised(self, features: Tensor) -> Tensor:
        """Return features of mean 0 and deviation 1 over the training queries."""
        return (features - self.mean) * self.scale

    def _read(self, batch: Batch) -> _Read:
        """Return what the nodes of all rows of a batch give, computed on the CPU."""
        found = []
        for index, fabric in enumerate(batch.fabric.tolist()):
            queries = Queries(*(getattr(batch, name)[index].numpy(force=True) for name in Queries._fields))
            found.append(self._of_nodes(fabric, queries, batch.row[index].numpy(force=True)))
        parts = np.split(np.concatenate(found), np.cumsum(_WIDTHS)[:-1], axis=1)
        columns = (torch.from_numpy(np.ascontiguousarray(part)) for part in parts)
        return _Read(*(part.to(batch.u.device) for part in (*columns, batch.target.flatten(0, 1))))

    def _of_nodes(self, fabric: int, queries: Queries, row: npt.NDArray[np.int64]) -> Float32:
        """Return what the nodes give of queries (n, sum of _WIDTHS), computed unless kept from an earlier step."""
        kept = (row >= 0) & (row < len(self._known))
        old = kept.copy()
        old[kept] = self._known[row[kept]]
        found = np.empty((len(row), sum(_WIDTHS)), np.float32)
        found[old] = self._kept[row[old]]
        if not old.all():
            asked = queries.take(~old)
            finest = read_queries(self._finest[fabric], asked).components
            found[~old] = np.concatenate([*read_queries(self._tables[fabric], asked), finest], axis=1)
            self._kept[row[kept]], self._known[row[kept]] = found[kept], True
        return found

    def _measure(self, fabrics: Sequence[Fabric]) -> None:
        """Measure mean and spread of the features over queries of all fabrics, before and after the exchange."""
        rows = []
        for index, (fabric, table) in enumerate(zip(fabrics, self._tables, strict=True)):
            repeat, count = fabric.weave.repeat, self.options.measured_rows
            rows.append(read_queries(table, draw_queries(QueryOptions(), repeat, _STREAM + index, 0, count)).features)
        features = np.concatenate(rows)
        features = np.concatenate([features, features[:, EXCHANGED] * EXCHANGED_SIGN]).astype(np.float64)
        self.mean.copy_(torch.from_numpy(features.mean(axis=0)))
        self.scale.copy_(torch.from_numpy(1.0 / (features.std(axis=0) + _LEAST_SPREAD)))


class _Cloth(NamedTuple):
    """A fabric's table, and the biases of the first layers of the correction and of the estimate."""

    table: SoftNodeTable
    bias: Tensor
    estimate_bias: Tensor


class _Folded:
    """A perceptron for many queries of one fabric; the normalisation and all that the fabric alone decides are folded.

    Parameters
    ----------
    layers : list of nn.Linear
        Its layers.
    network : SelvageNetwork
        The network with the normalisation.
    """

    def __init__(self, layers: Sequence[nn.Module], network: SelvageNetwork) -> None:
        first, *others = (layer for layer in layers if isinstance(layer, nn.Linear))
        with torch.no_grad():
            weight = first.weight * network.scale
            transposed, self._bias = weight.t().contiguous(), first.bias - weight @ network.mean
            self.of_query, self._of_fabric = transposed[:OF_QUERY].contiguous(), transposed[OF_QUERY:]
            self.others = [(layer.weight.t().contiguous(), layer.bias.clone()) for layer in others]

    def bias(self, own: Tensor) -> Tensor:
        """Return the bias of the first layer for a fabric of these features."""
        return self._bias + own @ self._of_fabric

    def __call__(self, features: Tensor, bias: Tensor) -> Tensor:
        """Return the outputs from OF_QUERY features of n queries and the bias of their fabric."""
        x = torch.addmm(bias, features, self.of_query)
        for weight, shift in self.others:
            x = torch.addmm(shift, functional.leaky_relu_(x, SLOPE), weight)
        return x


class _OverNodes:
    """A method over soft nodes, which answer all that its network is not trained for."""

    without_training: ClassVar[frozenset[str]] = SelvageOptions.without_training
    """Kinds of queries that need no training: the soft nodes know them."""
    turns: ClassVar[bool] = SelvageOptions.turns
    nodes: SoftNodes

    def outside_domain(self, fabric: Fabric, queries: Queries) -> Float32:
        """Answer N queries that the network is not trained for, float32 (N, 4), by the soft nodes alone."""
        return self.nodes.predict(fabric, queries)

    def transparency(self, fabric: Fabric, looks: Queries, seed: int = 0) -> Float32:
        """Return the transparency of N footprints, float32 (N,), by the soft nodes."""
        return self.nodes.transparency(fabric, looks)

    def coverage(self, fabric: Fabric, looks: Queries) -> Float32:
        """Return the share of view rays that do not leave curved cloth again, float32 (N,), as the soft nodes do."""
        return self.nodes.coverage(fabric, looks)


class Selvage(_OverNodes):
    """A trained network that answers for any fabric; it tabulates each once.

    Parameters
    ----------
    network : SelvageNetwork
        Trained weights.
    domain : Domain, optional
        Range of its training; any query of the soft nodes if left out.
    """

    def __init__(self, network: SelvageNetwork, domain: Domain | None = None) -> None:
        self.name, self.setting, self.domain = network.options.name, "", domain
        self.bound = network.options.bound
        self._network = network.eval()
        self._cloths = PerFabric(self._tabulate)
        self.nodes = SoftNodes(network.options.level, self.name, network.options.walls)
        self._tables = soft_tables(network.options.level, False, False, network.options.rims)
        self._correction = _Folded([*network.hidden, network.last], network)
        self._estimate = _Folded([network.errors.hidden, network.errors.last], network)
        self._answering = Answering(self._network, self._components)

    def covers(self, fabric: Fabric) -> bool:
        """Return True: any fabric can be tabulated."""
        return True

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric, once."""
        self._cloths.of(fabric)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries, float32 (N, 4); `seed` is not used. BadInput for kinds of queries that it does not know.

        Light from behind is answered by the soft nodes alone.
        """
        self._refuse(queries, *SelvageOptions.without_training)
        return row_by_row(
            queries,
            queries.wi[:, 2] < 0.0,
            lambda part: self.nodes.predict(fabric, part),
            lambda part: self._corrected(fabric, part),
        )

    def per_query(self, fabric: Fabric) -> PerQuery:
        """Return the network; the soft nodes are summed before it, and the bias of the fabric is its constant."""
        cloth = self._cloths.of(fabric)

        def inputs(queries: Queries) -> Columns:
            features, components, bounds = read_queries(cloth.table, queries)
            return np.ascontiguousarray(features[:, :OF_QUERY]), components, bounds

        return PerQuery(self._refuse, inputs, self._answering, (cloth.bias,))

    def layers(self, fabric: Fabric) -> list[LinearLayer]:
        """Return the correction, from OF_QUERY features to the arguments of four sigmoids.

        The first weights include the normalisation, the first biases all that the fabric alone decides.
        """
        correction = self._correction
        first = (correction.of_query, self._cloths.of(fabric).bias)
        return [LinearLayer(weight.numpy(), bias.numpy()) for weight, bias in (first, *correction.others)]

    @property
    def options(self) -> SelvageOptions:
        """The design."""
        return self._network.options

    def with_bound(self, bound: bool) -> Selvage:
        """Return the same network, bounded in energy or not."""
        other = Selvage(self._network, self.domain)
        other.bound, other.setting = bound, "bounded" if bound else "unbounded"
        return other

    def _components(self, features: Tensor, components: Tensor, bounds: Tensor, bias: Tensor) -> Tensor:
        """Answer from features, components and bounds of the soft nodes, and the bias of the fabric."""
        factors = LARGEST_FACTOR * torch.sigmoid(self._correction(features, bias).float())
        answer = factors * components
        return torch.minimum(answer, bounds) if self.bound else answer

    def _refuse(self, queries: Queries, *kinds: str) -> None:
        """Refuse queries of other kinds than these and flat cloth lit from the front."""
        refuse_other(queries, f"the method {self.name} answers", ("stretch", *kinds))

    def with_errors(self, fabric: Fabric, queries: Queries) -> tuple[Float32, Float32]:
        """Answer N queries lit from the front, and estimate errors as those of flat cloth.

        Returns
        -------
        float32 (N, 4), float32 (N, 2)
            Components; relative errors of a grey cloth's colour, root mean squares, of these components and of those by
            the finest soft nodes (`error_network`).
        """
        self._refuse(queries, "curvature")
        errors = np.empty((len(queries.u), 2), np.float32)
        return self._corrected(fabric, queries, errors), errors

    def within(self, error: float) -> Adaptive:
        """Return the method that answers by more nodes where the estimated error exceeds a relative error."""
        return Adaptive(self, error)

    def _corrected(self, fabric: Fabric, queries: Queries, errors: Float32 | None = None) -> Float32:
        """Answer by the soft nodes and the network; write estimated `errors` (N, 2), if an array is given."""
        cloth = self._cloths.of(fabric)
        table = self.nodes.table_for(fabric, queries) if (queries.curvature > 0.0).any() else cloth.table
        result = np.empty((len(queries.u), 4), np.float32)
        with torch.inference_mode():
            for start in range(0, len(result), CHUNK_ROWS):
                rows = slice(start, start + CHUNK_ROWS)
                features, components, bounds = map(torch.from_numpy, read_queries(table, queries.take(rows)))
                of_query = features[:, :OF_QUERY]
                result[rows] = self._components(of_query, components, bounds, cloth.bias).numpy()
                if errors is not None:
                    errors[rows] = self._estimate(of_query, cloth.estimate_bias).mul_(0.5).exp_().numpy()
        return result

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of the table and of the network."""
        return nbytes(self._cloths.of(fabric).table) + 4 * sum(weight.numel() for weight in self._network.parameters())

    def _tabulate(self, fabric: Fabric) -> _Cloth:
        """Return a fabric's table, and the biases of the first layers with all that the fabric alone decides."""
        table = self._tables.of(fabric)
        own = torch.from_numpy(cloth_features(table))
        return _Cloth(table, self._correction.bias(own), self._estimate.bias(own))


class Adaptive(_OverNodes, Around):
    """A trained `selvage` that answers by more nodes where its error would exceed the wished one.

    Parameters
    ----------
    selvage : Selvage
        Answers first, and estimates errors.
    error : float
        Wished relative error, above 0 and below 1; BadInput if it is another number.
    """

    def __init__(self, selvage: Selvage, error: float) -> None:
        if not 0.0 < error < 1.0:
            raise BadInput(selvage.name, "error", error, "a relative error above 0 and below 1 is needed, such as .02")
        super().__init__(selvage, f"error {100 * error:g} %")
        self.domain, self.error = selvage.domain, error
        self._selvage = selvage
        self.nodes = SoftNodes(selvage.options.finest, selvage.name, selvage.options.walls)

    def prepare(self, fabric: Fabric) -> None:
        """Tabulate the fabric for both levels of soft nodes and for the fallback, once."""
        self._selvage.prepare(fabric)
        self.nodes.prepare(fabric)
        fallback_answers(fabric, _ANY, 0)

    def predict(self, fabric: Fabric, queries: Queries, seed: int = 0) -> Float32:
        """Answer N queries, float32 (N, 4). BadInput for kinds of queries that the soft nodes do not know."""
        return row_by_row(
            queries,
            queries.wi[:, 2] < 0.0,
            lambda part: self.nodes.predict(fabric, part),
            lambda part: self._answers(fabric, part, seed),
        )

    def bytes_stored(self, fabric: Fabric) -> int:
        """Return the bytes of both tables and of the network; the tables of the fallback are shared by all methods."""
        return self._selvage.bytes_stored(fabric) + self.nodes.bytes_stored(fabric)

    def _answers(self, fabric: Fabric, queries: Queries, seed: int) -> Float32:
        """Answer queries with the light in front."""
        result, errors = self._selvage.with_errors(fabric, queries)
        too_far = errors[:, OWN] > self.error
        # The fallback sees rims: what is left of another meaning of walls stays with the finest nodes.
        finer = too_far & ((errors[:, FINEST] <= self.error) | (not self._selvage.options.rims))
        left = too_far & ~finer
        if finer.any():
            result[finer] = self.nodes.predict(fabric, queries.take(finer))
        if left.any():
            result[left] = fallback_answers(fabric, queries.take(left), seed)
        return result


def build(options: SelvageOptions, fabrics: Sequence[Fabric]) -> SelvageNetwork:
    """Return an untrained network for these fabrics."""
    return SelvageNetwork(options, fabrics)


def restore(options: SelvageOptions, trained: Trained) -> list[Selvage]:
    """Return the method of a trained network."""
    networks, domain = restored(options, trained, lambda _: SelvageNetwork(options))
    return [Selvage(network, domain) for network in networks.values()]
