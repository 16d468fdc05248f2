"""Woven cloth from Python: fabrics, their ground truth, trained models and data sets.

    load_fabric, Fabric     a draft and two yarns
    Queries                 a footprint, a light and a viewer in each row
    evaluate                the ground truth: components with their standard errors
    load_model              a model, which predicts the same components in less time
    to_rgb                  colours from components
    patch_bsdf              values, and directions drawn with their density, for a renderer
    open_dataset, Dataset   rows of a data set as NumPy arrays, a pandas frame, or batches of PyTorch
    COMPONENTS              names of the components, in the order of all arrays

Directions, units and what the components mean: `pipeline.truth.conventions`. Bad input raises `BadInput`, a ValueError
of one sentence.

Examples
--------
>>> COMPONENTS
('specular_warp', 'specular_weft', 'diffuse_warp', 'diffuse_weft')
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any


def _refuse_hidden_packages() -> None:
    """Raise ImportError if Python finds another package in place of ours, such as a folder beside a notebook."""
    for name in ("weaves", "pipeline", "reports", "jobs"):
        ours = Path(__file__).resolve().parent / name
        try:
            spec = find_spec(name)
        except ValueError:  # a module that somebody made by hand
            spec = None
        folders = [Path(found) for found in spec.submodule_search_locations or [str(spec.origin)]] if spec else []
        if ours not in [folder.resolve() for folder in folders]:
            found = f"finds {folders[0]}" if folders else "does not find it"
            allowed = "rename that one, or start Python in another folder"
            raise ImportError(f"twillight needs its package {name!r} in {ours}, but Python {found}: {allowed}")


_refuse_hidden_packages()

from pipeline.scenes.options import BOUNCES, Bounces  # noqa: E402, nothing of ours before the check
from pipeline.truth.conventions import COMPONENTS  # noqa: E402
from pipeline.truth.query import Queries  # noqa: E402
from weaves.errors import BadInput  # noqa: E402
from weaves.fabric import Fabric, load_fabric  # noqa: E402

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    from pipeline.models.method import Method
    from pipeline.models.patch_bsdf import PatchBSDF
    from pipeline.shards.manifest import Role, Split
    from pipeline.training.dataset import RowStream
    from pipeline.truth.query import Answers

__all__ = [
    "COMPONENTS",
    "BadInput",
    "Dataset",
    "Fabric",
    "Queries",
    "evaluate",
    "load_fabric",
    "load_model",
    "open_dataset",
    "patch_bsdf",
    "to_rgb",
]


def evaluate(fabric: Fabric, queries: Queries, *, seed: int = 0, **options: Any) -> Answers:
    """Evaluate the ground truth.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    queries : Queries
        N queries.
    seed : int
        Seed of the random numbers, 0 <= seed < 2^64; the same seed gives the same numbers.
    **options
        Options of the truth that are not to have their defaults, such as ``relative_error=0.005`` or
        ``estimator="owen"``; all are in `pipeline.truth.options.TruthOptions`.

    Returns
    -------
    Answers
        `mean`, its `standard_error` and `bound` (99.7 % of the errors are smaller), float32 (N, 4) in the order of
        `COMPONENTS`, in 1/sr with the incident cosine; `transparency`, (N,).

    Raises
    ------
    BadInput
        If a query has no answer, or an option does not exist or is out of its range.

    Examples
    --------
    >>> queries = Queries.round(u=[0.5], v=[0.5], sigma=[0.1], wi=[[0.6, 0, 0.8]], wo=[[0, 0, 1]])
    >>> answers = evaluate(load_fabric("denim"), queries, relative_error=0.01)
    >>> answers.mean.shape
    (1, 4)
    >>> bool(answers.standard_error.max() < 0.01 * answers.mean.sum())
    True
    """
    import numpy as np

    from pipeline.truth.estimator import estimate
    from pipeline.truth.options import TruthOptions
    from weaves.validation import validated

    chosen = validated(TruthOptions, options, "evaluate")
    if not 0 <= seed < 2**64:
        raise BadInput("evaluate", "seed", seed, "must be from 0 to 2^64 - 1")
    single = Queries(*(np.ascontiguousarray(column, np.float32) for column in queries))
    return estimate(fabric, single, chosen, seed)


def load_model(name_or_folder: str | Path) -> Method:
    """Load a model, to answer many queries on all cores.

    Parameters
    ----------
    name_or_folder : str or Path
        Name of a model that learns nothing, such as ``"soft_nodes:2"`` with k = 2 or ``"selvage:.02"`` for an error
        of 2 %, or the folder of a trained model.

    Returns
    -------
    Method
        ``predict(fabric, queries)`` returns the components of N queries, float32 (N, 4). It refuses kinds of queries
        that the model does not know; yarns unlike those of its training are extrapolated. No bit of an answer depends
        on the number of cores. `selvage` also takes ``error=.02``, the wished relative error of the colour, or
        ``time=5e-6``, the wished mean seconds of a query on one thread of this machine.

    Raises
    ------
    BadInput
        If there is no such model, it must be trained first, or its files are damaged or of another version.

    Examples
    --------
    >>> model = load_model("selvage")
    >>> queries = Queries.round(u=[0.5], v=[0.5], sigma=[0.1], wi=[[0.6, 0, 0.8]], wo=[[0, 0, 1]])
    >>> model.predict(load_fabric("denim"), queries).shape
    (1, 4)
    """
    from pipeline.models.all_cores import AllCores
    from pipeline.models.named import loaded

    method, _ = loaded(str(name_or_folder), "load_model", "name_or_folder")
    return AllCores(method)


def to_rgb(
    fabric: Fabric, components: npt.ArrayLike, queries: Queries, bounces: Bounces = BOUNCES
) -> npt.NDArray[np.float64]:
    """Return the patch BSDF in linear sRGB: the components times the colours of a fabric's yarns.

    Parameters
    ----------
    fabric : Fabric
        The cloth.
    components : array_like (N, 4)
        Components from `evaluate` or a model.
    queries : Queries
        Their N queries: light from behind takes other colours.
    bounces : 1 or "all"
        One leaves out the light that yarns give to each other, up to a fifth of that of white cloth. The first call
        for a cloth takes seconds for it, and colours change nothing of it.

    Returns
    -------
    float64 (N, 3)
        In 1/sr, with the incident cosine: a light of irradiance pi shows ``np.pi * to_rgb(...)``.

    Examples
    --------
    >>> queries = Queries.round(u=[0.5], v=[0.5], sigma=[0.1], wi=[[0.6, 0, 0.8]], wo=[[0, 0, 1]])
    >>> denim = load_fabric("denim")
    >>> to_rgb(denim, [[0.0, 0.0, 1.0, 0.0]], queries, bounces=1)[0].tolist() == list(denim.warp.diffuse_rgb)
    True
    """
    from pipeline.scenes.shade import shade

    return shade(fabric, components, queries, bounces)


def patch_bsdf(fabric: Fabric, method: str = "soft_nodes:2") -> PatchBSDF:
    """Return a cloth's patch BSDF with importance sampling, as a renderer uses it.

    Parameters
    ----------
    fabric : Fabric
        The cloth, with its colours.
    method : str
        Who answers: a model that comes with the package or learns nothing, with ``:k`` for a setting, or the folder of
        a trained one.

    Returns
    -------
    PatchBSDF
        ``sample(looks, random)`` draws a light direction for each of N footprints and viewers, with its density and
        weight; ``eval(queries)`` returns linear RGB (N, 3) with the incident cosine, ``pdf(queries)`` the density (N,).
        Light straight through is drawn as a delta lobe. Footprints of any shape, both sides.

    Raises
    ------
    BadInput
        If there is no such method.

    Examples
    --------
    The weights of many directions have the reflected light of an even sky as their mean:

    >>> import numpy as np
    >>> silk, up = patch_bsdf(load_fabric("silk_charmeuse")), np.tile([0.0, 0.0, 1.0], (5000, 1))
    >>> half = np.full(5000, 0.5)
    >>> looks = Queries.round(u=half, v=half, sigma=half, wi=up, wo=up)
    >>> sample = silk.sample(looks, np.random.default_rng(0).random((5000, 3)))
    >>> bool(0 < sample.weight.mean() < 1)
    True
    >>> scattered = ~sample.straight
    >>> queries = looks._replace(wi=sample.wi).take(scattered)
    >>> bool(np.allclose(silk.eval(queries) / silk.pdf(queries)[:, None], sample.weight[scattered]))
    True
    """
    from pipeline.models.patch_bsdf import PatchBSDF

    return PatchBSDF(fabric, method)


def open_dataset(folder: str | Path) -> Dataset:
    """Open a data set.

    Parameters
    ----------
    folder : str or Path
        A folder that `twillight generate` or `twillight publish` wrote, such as ``out/datasets/NAME-FINGERPRINT``, or
        its address in object storage.

    Raises
    ------
    BadInput
        If the folder has no manifest, its manifest is damaged, or of another version.

    Examples
    --------
    >>> open_dataset("out/datasets/tiny").roles["unseen"]
    ['twill_4_4']
    """
    from pipeline.storage import place

    return Dataset(place(str(folder), "folder"))


class Dataset:
    """Rows of a data set, by split and fabric.

    Attributes
    ----------
    fabrics : dict of str to Fabric
        Its fabrics.
    roles : dict of str to list of str
        Names of the fabrics that are `seen`, of the `population`, `unseen`, and of the `unseen_population`.

    Examples
    --------
    >>> dataset = open_dataset("out/datasets/tiny")
    >>> dataset.fabrics["denim"].weave.repeat
    (4, 4)
    """

    def __init__(self, folder: Path) -> None:
        from pipeline.shards.pieces import DatasetRows

        self._rows = DatasetRows.load(folder)
        self.fabrics: dict[str, Fabric] = self._rows.fabrics
        self.roles: dict[Role, list[str]] = self._rows.roles

    def numpy(self, fabric: str, split: Split) -> tuple[Queries, Answers]:
        """Return the rows of a fabric's split (train, validation or test) as arrays.

        Raises
        ------
        BadInput
            If there are none, or a file is missing or damaged.

        Examples
        --------
        >>> queries, answers = open_dataset("out/datasets/tiny").numpy("denim", "test")
        >>> answers.mean.shape == (len(queries.u), 4)
        True
        """
        from pipeline.shards.store import rows_of

        frame = self.pandas(split, [fabric])
        return rows_of({name: frame[name].to_numpy() for name in frame.columns[1:]})

    def pandas(self, split: Split, fabrics: list[str] | None = None) -> pd.DataFrame:
        """Return the rows of a split as a frame: one column for the fabric, and one for each number of a row.

        The rows of all fabrics that have this split, or of those named; errors as `numpy`.

        Examples
        --------
        >>> frame = open_dataset("out/datasets/tiny").pandas("test")
        >>> sorted(frame["fabric"].unique())
        ['denim', 'twill_4_4']
        >>> bool((frame.groupby("fabric", observed=True)["diffuse_warp"].mean() > 0).all())
        True
        """
        import pandas as pd

        pieces = self._rows.of(split, fabrics)
        parts = [pd.DataFrame({"fabric": piece.fabric, **piece.read()}) for piece in pieces]
        return pd.concat(parts, ignore_index=True).astype({"fabric": "category"})

    def torch(
        self, split: Split, rows: int = 4096, fabrics: list[str] | None = None, seed: int | None = 0
    ) -> RowStream:
        """Return the rows of a split as an iterable data set of PyTorch, in batches.

        Parameters
        ----------
        split : str
            train, validation or test.
        rows : int
            Most rows of a batch.
        fabrics : list of str, optional
            Names; all that have this split if left out.
        seed : int or None
            Seed of the order, another one in each pass; None keeps the order of the files.

        Returns
        -------
        RowStream
            Yields dictionaries of tensors by column, (n,) each, and the number of the fabric in `fabric`. For a
            DataLoader with ``batch_size=None``, whose workers share the files.

        Examples
        --------
        >>> batches = open_dataset("out/datasets/tiny").torch("train", rows=100)
        >>> max(len(batch["sigma"]) for batch in batches)
        100
        """
        from pipeline.training.dataset import RowStream

        return RowStream(self._rows.of(split, fabrics), rows, seed)
