"""A synthetic bidirectional texture: every texel of a repeat with its own number of angular samples, in any order.

Samples are drawn and answered as a pure function of seed and texel, so texels can be cut into shards at will; how they
lie in the file is told in pipeline.shards.btf_store.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, Field, model_validator

from pipeline import versions
from pipeline.fingerprint import fingerprint
from pipeline.shards.queries import QueryOptions, draw_queries
from pipeline.truth.options import TruthOptions
from weaves.fabric import Fabric

MOST_SAMPLES: Final = 1 << 20
"""Most samples of one texel; so many names in the stream of random numbers are reserved for each."""


class BtfTask(BaseModel):
    """Everything that a synthetic BTF's numbers depend on, and the fabric's name."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)

    fabric: Fabric
    """The fabric, colours included."""
    texels_per_yarn: int = Field(default=8, ge=1, le=256)
    """Texels along a yarn spacing; texel t of the repeat lies in row t // width, column t % width."""
    start: int = Field(default=0, ge=0)
    """First texel of this shard."""
    texels: int | None = Field(default=None, ge=1)
    """Texels in this shard; left out: up to the last of the repeat."""
    sigma: float = Field(default=0.5, gt=0)
    """Standard deviation of a texel's footprint, in texels."""
    samples: tuple[int, int] = (64, 128)
    """Fewest and most samples of a texel; each texel draws its own number, evenly."""
    order: int = Field(default=0, ge=0)
    """Seed of the order in which a texel's samples are stored; it changes no sample."""
    seed: int = Field(ge=0)
    """Seed of numbers of samples, directions and points."""
    directions: Literal["projected_disc", "hemisphere"] = "projected_disc"
    """Density of both directions, as in `QueryOptions`."""
    max_angle: float = Field(default=80.0, gt=0, le=89.9)
    """Largest angle of either direction to the macro normal, in degrees."""
    truth: TruthOptions = TruthOptions()
    """How samples are answered."""

    @model_validator(mode="after")
    def _can_be_cut(self) -> BtfTask:
        low, high = self.samples
        if not 0 <= low <= high <= MOST_SAMPLES:
            raise ValueError(f"samples must be [low, high] with 0 <= low <= high <= {MOST_SAMPLES}, got {self.samples}")
        width, height = self.grid
        if self.start + (self.texels or 1) > width * height:
            raise ValueError(
                f"texels {self.start} to {self.start + (self.texels or 1)} of {width * height} do not exist"
            )
        return self

    @property
    def grid(self) -> tuple[int, int]:
        """Texels of the whole repeat in x and in y."""
        ends, picks = self.fabric.weave.repeat
        return ends * self.texels_per_yarn, picks * self.texels_per_yarn

    @property
    def indices(self) -> range:
        """Texels of this shard."""
        width, height = self.grid
        return range(self.start, width * height if self.texels is None else self.start + self.texels)

    def identity(self) -> dict[str, Any]:
        """Return what the numbers depend on, colours and versions included, sources left out."""
        specification = self.model_dump(mode="json", exclude={"fabric"})
        return {
            "kind": "btf",
            "version": versions.TRUTH,
            "name": self.fabric.name,
            **_look(self.fabric),
            **specification,
        }


def generate_btf(task: BtfTask, path: Path, progress: Callable[[float], None] = lambda fraction: None) -> None:
    """Answer a task's samples and write them to `path`; a texel's depend on its own index alone.

    Parameters
    ----------
    task : BtfTask
        What to answer.
    path : Path
        The file; it appears whole.
    progress : callable
        Told the share done.
    """
    # Imported here so that a plan can name tasks without loading compilers.
    from pipeline.shards.btf_store import Btf, write_btf
    from pipeline.truth.estimator import estimate

    width, _ = task.grid
    stream = [_look(task.fabric), task.texels_per_yarn, task.sigma, task.seed]
    count_seed, query_seed, point_seed = (_seed(purpose, stream) for purpose in ("count", "queries", "points"))
    order_seed = _seed("order", [task.order, *stream])
    options = QueryOptions(directions=task.directions, max_angle=task.max_angle)
    low, high = task.samples
    warp, weft = task.fabric.warp, task.fabric.weft
    colours = np.array([warp.specular_rgb, weft.specular_rgb, warp.diffuse_rgb, weft.diffuse_rgb], np.float64)

    centres, counts, samples = [], [], [np.zeros((0, 12), np.float32)]
    for texel in task.indices:
        row, column = divmod(texel, width)
        centre = [(column + 0.5) / task.texels_per_yarn, (row + 0.5) / task.texels_per_yarn]
        centres.append([*centre, task.sigma / task.texels_per_yarn])
        progress((texel - task.start) / len(task.indices))
        counts.append(int(_generator(count_seed, texel).integers(low, high, endpoint=True)))
        if not counts[-1]:
            continue
        drawn = draw_queries(options, (1, 1), query_seed, texel * MOST_SAMPLES, counts[-1])
        u, v, sigma = (np.full(counts[-1], value, np.float32) for value in centres[-1])
        queries = drawn._replace(u=u, v=v, sigma=sigma, sigma_minor=sigma)
        answers = estimate(task.fabric, queries, task.truth, point_seed, texel * MOST_SAMPLES)
        # Added as if the components' errors were independent; over seeds that is right within 6 % at the median.
        error = np.sqrt(answers.standard_error.astype(np.float64) ** 2 @ colours**2)
        parts: list[npt.NDArray[Any]] = [queries.wi, queries.wo, answers.mean @ colours, error]
        order = _generator(order_seed, texel).permutation(counts[-1])
        samples.append(np.concatenate(parts, axis=1).astype(np.float32)[order])
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    u, v, sigma = np.array(centres, np.float32).T
    together = np.concatenate(samples)
    write_btf(path, Btf(u, v, sigma, offsets, *np.split(together, 4, axis=1)), {"task": task.identity()})


def _look(fabric: Fabric) -> dict[str, Any]:
    """Return all of a fabric that shapes a texel's colours."""
    families = {"warp": fabric.warp, "weft": fabric.weft}
    colours = {name: [list(yarn.specular_rgb), list(yarn.diffuse_rgb)] for name, yarn in families.items()}
    return {"optics": fabric.optics(), "colours": colours}


def _seed(purpose: str, stream: list[Any]) -> int:
    """Return the 64-bit name of a stream of random numbers."""
    return int(fingerprint(["btf", purpose, *stream], 16), 16)


def _generator(seed: int, texel: int) -> np.random.Generator:
    """Return a texel's own generator: counter based, its counter set to the texel [Salmon2011Philox]."""
    return np.random.Generator(np.random.Philox(key=seed, counter=[0, 0, texel, 0]))
