"""Frames of a scene: the queries, computed once and stored, and their values by the truth and by methods.

The file, NumPy's npz, holds every query of all frames with the truth's answer, and the pictures without the light
that the cloth scatters: the backdrop, and what of it comes straight through the cloth. A method's picture is that plus
the sum over queries of irradiance times coverage and f_P. So methods differ in the patch BSDF alone; what passes
straight through cloth is the truth's for all of them, and so is the coverage at silhouettes. Light between yarns is
that of the cloth's one table.
"""

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from pipeline.atomic import atomic_write
from pipeline.compiled.arrays import Float32, Float64, Index, Mask
from pipeline.fingerprint import fingerprint
from pipeline.models.fallback import Fallback, fallback_answers
from pipeline.models.method import Method
from pipeline.scenes.bounces import light_between, seen_light
from pipeline.scenes.catalogue import load_scene
from pipeline.scenes.frame import render
from pipeline.scenes.loading import load
from pipeline.scenes.shade import coloured, colours_of, compose
from pipeline.truth.estimator import estimate
from pipeline.truth.geometry.opacity import coverage
from pipeline.truth.query import Queries
from pipeline.truth.scattering.thread_colours import component_colours
from reports.options import ShotOptions
from weaves.errors import BadInput
from weaves.fabric import Fabric

_RIM = "rim."
_COLUMNS = ("frame", "pixel", "weight", "mean", "standard_error", "fallback_values")


class ClothQueries(NamedTuple):
    """M queries on one cloth over all F frames."""

    fabric: Fabric
    queries: Queries
    frame: Index  # frame of each query, (M,)
    pixel: Index  # its pixel in the frame, below H W
    weight: Float32  # linear RGB irradiance times the truth's coverage, (M, 3)
    mean: Float32  # the truth's answers, (M, 4)
    standard_error: Float32
    fallback_values: Float32
    """Answers of the fallback where light or viewer is behind the cloth, for methods that do not know such queries,
    (M, 4); 0 elsewhere."""
    colours: npt.NDArray[np.floating]
    """The truth's, of the components, (M, 4, 3). Methods have those of the footprint's threads
    (`pipeline.scenes.shade`)."""
    between: Float32
    """Light of all bounces after the first (`pipeline.scenes.bounces.light_between`), (M, 4, 3); zeros (1, 4, 1) if
    there is one bounce."""
    rims: Queries  # R places at silhouettes, in all frames, of which some view rays leave the cloth again
    coverage: Float32  # the truth's coverage of each, (R,)

    def light(self, components: npt.ArrayLike | None = None) -> Float64:
        """Return the light of each query, (M, 3), from a method's components (M, 4); the truth's if left out."""
        values: npt.ArrayLike = self.mean
        colours = self.colours
        if components is not None:
            values, colours = components, colours_of(self.fabric, self.queries)
        return np.asarray(self.weight * (coloured(values, colours) + seen_light(self.between, colours).sum(axis=1)))

    def noise(self) -> Float64:
        """Return the standard error of the truth's light, (M, 3), components taken to be uncorrelated."""
        squared = np.square(self.standard_error.astype(np.float64))
        return np.asarray(self.weight * np.sqrt(coloured(squared, np.square(self.colours))))


class Shot(NamedTuple):
    """A scene's frames."""

    name: str
    base: Float32  # linear RGB without the light that the cloth scatters, (F, H, W, 3)
    cloths: list[ClothQueries]  # in the order of the scene

    @property
    def lit(self) -> Mask:
        """Pixels with at least one query, (F, H, W)."""
        result = np.zeros(self.base.shape[:3], np.bool_)
        for cloth in self.cloths:
            result.reshape(len(result), -1)[cloth.frame, cloth.pixel] = True
        return result

    def pictures(self, answers: list[Float32] | None = None) -> Float64:
        """Return the frames, (F, H, W, 3), from each cloth's components (M, 4); the truth's if left out."""
        result = self.base.astype(np.float64)
        flat = result.reshape(len(result), -1, 3)
        for index, cloth in enumerate(self.cloths):
            light = cloth.light(None if answers is None else answers[index])
            np.add.at(flat, (cloth.frame, cloth.pixel), light)
        return result

    def noise(self) -> Float64:
        """Return the standard error of the truth's frames, (F, H, W, 3); of a pixel's lights it adds in quadrature."""
        squared = np.zeros(self.base.shape)
        flat = squared.reshape(len(squared), -1, 3)
        for cloth in self.cloths:
            np.add.at(flat, (cloth.frame, cloth.pixel), np.square(cloth.noise()))
        return np.sqrt(squared)

    def covered_by(self, method: Method) -> bool:
        """Return whether a method answers for every cloth."""
        return all(method.covers(cloth.fabric) for cloth in self.cloths)

    def answers(self, method: Fallback, seed: int) -> list[Float32]:
        """Return a method's components for every cloth; random methods draw anew in every frame.

        Queries that fall back because light or viewer is behind the cloth were answered once for all methods.
        """
        components = []
        for cloth in self.cloths:
            method.prepare(cloth.fabric)
            values = cloth.fallback_values.copy()
            answered = method.out_of_domain(cloth.fabric, cloth.queries) & cloth.queries.behind
            for frame in range(len(self.base)):
                rows = np.flatnonzero((cloth.frame == frame) & ~answered)
                if rows.size:
                    own = int(fingerprint([self.name, cloth.fabric.name, frame, seed]), 16)
                    values[rows] = method.predict(cloth.fabric, cloth.queries.take(rows), own)
            components.append(values)
        return components

    def rim_errors(self, method: Fallback, seed: int) -> Float64:
        """Return the errors of a method's coverage at the silhouettes of all cloths and frames, (R,)."""
        parts = (method.coverage(cloth.fabric, cloth.rims, seed) - cloth.coverage for cloth in self.cloths)
        return np.concatenate(list(parts)).astype(np.float64)


def shoot(name: str, options: ShotOptions, path: Path, progress: Callable[[float], None] = lambda share: None) -> None:
    """Work out a scene's frames with the truth's answers and write them to `path`; `progress` receives their share.

    BadInput if the scene cannot be used (`pipeline.scenes`), or shows no cloth.
    """
    loaded = load(load_scene(name), options.options)
    bases: list[npt.NDArray[np.floating]] = []
    parts: dict[str, list[dict[str, npt.NDArray[Any]]]] = {key: [] for key in loaded.cloths}
    for frame in range(options.frames):
        seen = render(loaded, float(frame), options.size)
        base: npt.NDArray[np.floating] = seen.backdrop
        for key, gbuffer in seen.gbuffers.items():
            fabric = loaded.cloths[key][1]
            truth = options.frame_truth if frame else options.truth
            seed = int(fingerprint(["scene", loaded.scene.name, key, frame, options.seed]), 16)
            queries = gbuffer.queries(fabric.repeat)
            answers = estimate(fabric, queries, truth, seed)
            dark = np.zeros((len(gbuffer.place), 3))
            rims = gbuffer.rims(fabric.repeat)
            of_rims, doubt = coverage(fabric, rims, truth, seed)
            covered = gbuffer.coverage(of_rims)
            through = np.zeros(len(gbuffer.pixel))
            through[gbuffer.place] = answers.transparency  # that of any query of a place
            base = compose(gbuffer, dark, base, through, covered)
            columns = {"frame": np.full(len(gbuffer.place), frame), "pixel": gbuffer.pixel[gbuffer.place]}
            columns |= queries._asdict() | {
                "weight": (gbuffer.irradiance * covered[gbuffer.place, None]).astype(np.float32)
            }
            columns |= {"mean": answers.mean, "standard_error": answers.standard_error}
            columns |= {"fallback_values": fallback_values(fabric, queries, seed)}
            if loaded.options.bounces == "all":
                columns |= {"between": light_between(fabric, queries).astype(np.float32)}
            if fabric.colours is not None:
                columns |= {"colours": component_colours(fabric, queries, truth, seed).mean.astype(np.float32)}
            sampled = (doubt > 0.0) & (of_rims < 1.0)  # the rest is certain, or covered
            columns |= {_RIM + name: column[sampled] for name, column in rims._asdict().items()}
            columns |= {_RIM + "coverage": of_rims[sampled]}
            parts[key].append(columns)
        bases.append(base)
        progress((frame + 1) / (options.frames + 1))
    arrays = {"base": np.array(bases, np.float32)}
    keys = [key for key, frames_of in parts.items() if sum(len(part["frame"]) for part in frames_of)]
    if not keys:
        raise BadInput(name, "frames", options.frames, "no cloth that is lit is in sight of the camera")
    for key in keys:
        arrays |= {f"{key}.{name}": np.concatenate([part[name] for part in parts[key]]) for name in parts[key][0]}
    about = {"name": loaded.scene.name, "cloths": {key: loaded.cloths[key][1].model_dump(mode="json") for key in keys}}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, about=np.array(json.dumps(about)), **arrays)  # type: ignore[arg-type]
    atomic_write(path, buffer.getvalue())


def read_shot(path: Path) -> Shot:
    """Read what `shoot` wrote."""
    with np.load(path, allow_pickle=False) as file:
        about = json.loads(str(file["about"]))
        cloths = []
        for key, fabric in about["cloths"].items():
            queries = Queries(*(file[f"{key}.{column}"] for column in Queries._fields))
            cloth = Fabric.model_validate(fabric)
            columns = {column: file[f"{key}.{column}"] for column in _COLUMNS}
            colours = colours_of(cloth, queries) if cloth.colours is None else file[f"{key}.colours"]
            rims = Queries(*(file[f"{key}.{_RIM}{column}"] for column in Queries._fields))
            covered = file[f"{key}.{_RIM}coverage"]
            between = file[f"{key}.between"] if f"{key}.between" in file else np.zeros((1, 4, 1), np.float32)
            cloths.append(
                ClothQueries(cloth, queries, **columns, colours=colours, between=between, rims=rims, coverage=covered)
            )
        return Shot(about["name"], file["base"], cloths)


def fallback_values(fabric: Fabric, queries: Queries, seed: int) -> Float32:
    """Return the answers of the fallback where light or viewer is behind the cloth, (M, 4); 0 elsewhere."""
    result, rows = np.zeros((len(queries.u), 4), np.float32), queries.behind
    if rows.any():
        result[rows] = fallback_answers(fabric, queries.take(rows), seed)
    return result
