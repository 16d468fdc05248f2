"""Measurements on fabrics: of the truth, of a model on one, on random unseen ones, at extremes, between them; times."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from jobs.plan.measurements.measurement import Measurement
from jobs.plan.measurements.subjects import HeldOutRows, Subjects, Trained
from jobs.plan.measurements.truth import TruthEdge, TruthFrames, TruthPicture
from jobs.plan.task import Coloured, Made, Progress, Uncoloured
from pipeline.scenes.options import View
from pipeline.shards.queries import QueryOptions
from pipeline.truth.options import TruthOptions
from reports import options
from reports.catalogue import AddedMetric
from reports.options import TimingOptions
from reports.page.content import PictureFile
from weaves.fabric import Fabric, load_fabric

if TYPE_CHECKING:
    from reports.measure.held_out import HeldOutFabric
    from reports.record import Record


_SECONDS_A_CALL = 0.025  # one row takes six calls a round, all queries and five classes of sizes; one more if unseen


class _OnHeldOut(Measurement):
    fabric: Coloured
    role: options.Role
    dataset: HeldOutRows
    errors: options.ErrorOptions  # number of these queries

    @classmethod
    def of(cls, subjects: Subjects, fabric: Fabric, role: options.Role, **more: Any) -> Self:
        rows, errors = subjects.held_out(fabric), options.select(options.ErrorOptions, subjects.recipe.bench)
        return cls(fabric=fabric, role=role, dataset=rows, errors=errors, **more)

    def held_out(self, out: Path) -> HeldOutFabric:
        (rows,) = self.dataset.read(out, [self.fabric.name], self.errors.rows)
        return rows


class TruthNoise(_OnHeldOut):
    """The truth's noise on a fabric's held-out queries, and the motion in its frames."""

    kind: Literal["truth noise"] = "truth noise"
    frames: Made
    frame_options: options.FrameOptions

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a fabric."""
        chosen = options.select(options.FrameOptions, subjects.recipe.bench)
        for fabric, role in subjects.fabrics:
            (frames,) = TruthFrames.of(fabric, subjects.recipe)
            yield cls.of(subjects, fabric, role, frames=frames.made, frame_options=chosen)

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure it."""
        from reports.measure import frames, held_out

        motion = frames.measure_truth_frames(self.fabric, self.frame_options, out / self.frames.path)
        return [held_out.measure_truth(self.held_out(out)), *motion]


class OnFabric(_OnHeldOut):
    """All methods of a model, one a setting, on one fabric: errors, white furnace, aliasing, silhouettes, pictures."""

    kind: Literal["errors"] = "errors"
    model: Trained
    ways: options.RunOptions
    frames: Made
    frame_options: options.FrameOptions
    views: dict[View, Made]
    picture_options: options.PictureOptions
    shown: tuple[str, ...]  # settings that pictures are made of
    edge: Made | None  # the truth's edge, where cloth is curved
    edge_options: options.EdgeOptions | None

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a fabric, model that answers for it, and seed; pictures are made of the first seed alone."""
        recipe, bench = subjects.recipe, subjects.recipe.bench
        for fabric, role in subjects.fabrics:
            (frames,), edges = TruthFrames.of(fabric, recipe), TruthEdge.of(fabric, recipe)
            views = {picture.scene: picture.made for picture in TruthPicture.of(fabric, recipe)}
            for model in subjects.answering([fabric.name]):
                yield cls.of(
                    subjects,
                    fabric,
                    role,
                    model=model,
                    ways=model.run_options(bench),
                    frames=frames.made,
                    frame_options=options.select(options.FrameOptions, bench),
                    views=views if model.is_first else {},
                    picture_options=options.select(options.PictureOptions, bench),
                    shown=model.shown(bench.picture_counts) if model.is_first else (),
                    edge=edges[0].made if edges else None,
                    edge_options=bench.edge if edges else None,
                )

    @property
    def pictures(self) -> tuple[PictureFile, ...]:
        """A picture a view and setting shown."""
        return tuple(
            PictureFile(self.fabric.name, view, self.model.options.name, setting, self.picture(setting, view))
            for setting in self.shown
            for view in self.views
        )

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        queries = self.frame_options.frames * math.prod(self.frame_options.frame_size) + self.errors.rows
        pixels = sum(math.prod(self.picture_options.size(view)) for view in self.views)
        return 0.3 + self.model.seconds(queries + pixels, 1.0, self.ways)

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure one method after the other."""
        from reports.measure import frames, furnace, held_out, pictures, silhouette

        rows, methods, records = self.held_out(out), self.model.methods(out), []
        methods += self.model.variants(methods, self.ways)
        for index, method in enumerate(methods, start=1):
            records += held_out.measure_errors(method, rows, self.errors.seed)
            records += furnace.measure_furnace(method, self.fabric)
            records += frames.measure_aliasing(method, self.fabric, self.frame_options, out / self.frames.path)
            if self.edge and self.edge_options:
                records += silhouette.measure_silhouette(method, self.fabric, self.edge_options, out / self.edge.path)
            for view, truth in self.views.items() if method.setting in self.shown else ():
                paths = out / truth.path, out / self.picture(method.setting, view)
                records += pictures.render_method(method, self.fabric, view, self.picture_options, *paths)
            progress(index / len(methods))
        return records


class OnUnseenPopulation(Measurement):
    """All methods of a model, one a setting, on every random unseen fabric.

    There are no pictures of them: the truth of one picture costs more than all held-out queries of a fabric.
    """

    kind: Literal["errors on random fabrics"] = "errors on random fabrics"
    role: ClassVar[options.Role] = "unseen"
    model: Trained
    ways: options.RunOptions
    fabrics: tuple[Coloured, ...]
    dataset: HeldOutRows
    errors: options.ErrorOptions  # number of these queries, each fabric

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a seed and model that answers for all of the fabrics: models of one material do not."""
        fabrics, bench = subjects.recipe.unseen_population, subjects.recipe.bench
        for model in subjects.answering([fabric.name for fabric in fabrics]) if fabrics else ():
            yield cls(
                model=model,
                ways=model.run_options(bench),
                fabrics=fabrics,
                dataset=subjects.held_out(*fabrics),
                errors=options.select(options.ErrorOptions, bench),
            )

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return 0.3 + self.model.seconds(len(self.fabrics) * self.errors.rows, len(self.fabrics), self.ways)

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure one method after the other."""
        from reports.measure.held_out import measure_errors

        methods, records = self.model.methods(out), []
        methods += self.model.variants(methods, self.ways)
        names = [fabric.name for fabric in self.fabrics]
        for index, method in enumerate(methods):
            for done, rows in enumerate(self.dataset.read(out, names, self.errors.rows), start=1):
                records += measure_errors(method, rows, self.errors.seed)
                progress((index + done / len(names)) / len(methods))
        return records


class ErrorsBySize(Measurement):
    """Errors of one training of a model by the size of footprints, on the held-out queries of all fabrics.

    Those of the first training are measured with its times.
    """

    kind: Literal["errors by size"] = "errors by size"
    model: Trained
    dataset: HeldOutRows
    seed: int  # seed of the points of random methods

    @property
    def cost(self) -> float:
        """Estimated seconds on one core; a shard of test rows is about one fabric."""
        return 1.0 + self.model.seconds(0.0, len(self.dataset.rows))

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a model and seed after its first."""
        dataset = subjects.held_out(*(fabric for fabric, _ in subjects.fabrics))
        for model in subjects.models:
            if not model.is_first:
                yield cls(model=model, dataset=dataset, seed=subjects.recipe.bench.seed)

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure all classes of footprints."""
        from reports.measure.by_size import measure_errors_by_size

        return measure_errors_by_size(self.model.methods(out), self.dataset.read(out), self.seed)


class TimedModel(Trained):
    """A model with all its networks, and the ways to run them that are timed too."""

    ways: options.RunOptions


class TimeOfMethods(Measurement):
    """Times of all methods side by side, on all fabrics with a name and by the size of footprints; on unseen ones."""

    kind: Literal["timing of all methods"] = "timing of all methods"
    timed: ClassVar = True
    code: ClassVar = ("truth", "bench")  # the truth is timed too
    models: tuple[TimedModel, ...]
    dataset: HeldOutRows
    unseen: tuple[str, ...]  # names of the fabrics that no general model was trained on
    options: TimingOptions

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield the one of the recipe, of models trained with their first seed: times do not depend on the weights."""
        bench, firsts = subjects.recipe.bench, (model for model in subjects.models if model.is_first)
        yield cls(
            models=tuple(TimedModel(ways=model.run_options(bench), **dict(model)) for model in firsts),
            dataset=subjects.held_out(*(fabric for fabric, _ in subjects.recipe.tested)),
            unseen=tuple(fabric.name for fabric, role in subjects.recipe.tested if role == "unseen"),
            options=options.select(TimingOptions, bench),
        )

    @property
    def cost(self) -> float:
        """Estimated seconds; a shard of test rows is about one fabric."""
        rows = sum(len(model.options.settings) or 1 for model in self.models)
        prepared = sum(model.seconds(0.0, len(self.dataset.rows), model.ways) for model in self.models)
        calls = rows * self.options.timing_repeats * (6 + bool(self.unseen))
        return 5.0 + calls * _SECONDS_A_CALL + 0.7 * prepared

    @property
    def threads(self) -> int:
        """Most threads that methods are timed with."""
        from reports.measure.timing import thread_counts

        return max(thread_counts(self.options.threads))

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Time all queries, those of unseen fabrics, then queries by the size of their footprints."""
        from pipeline.models.runtimes import not_run
        from reports.measure.by_size import measure_by_size
        from reports.measure.held_out import measure_timing
        from reports.record import Record

        truth = TruthOptions.model_validate(self.dataset.manifest(out).about["truth"])
        loaded = [(model, model.methods(out)) for model in self.models]
        methods = [method for _, own in loaded for method in own]
        timed = [*methods, *(run for model, own in loaded for run in model.variants(own, model.ways))]
        rows = list(self.dataset.read(out, rows=self.options.rows))
        unseen = list(self.dataset.read(out, self.unseen, self.options.rows))
        records = measure_timing(timed, rows, truth, self.options, lambda share: progress(0.6 * share), unseen)
        for model, own in loaded:
            for method in own:  # those runtimes that this machine lacks
                for name, reason in not_run(method, model.ways.runtimes).items():
                    records.append(Record(method=method.name, setting=name, metric="not_run", value=1.0, note=reason))
        rows = list(self.dataset.read(out))
        return records + measure_by_size(methods, rows, self.options, lambda share: progress(0.6 + 0.4 * share))


class OfAddedMetric(_OnHeldOut):
    """A metric from outside, of all methods of a model, on the held-out queries of a fabric."""

    kind: Literal["added metric"] = "added metric"
    metric: AddedMetric
    model: Trained

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a metric, fabric, model that answers for it, and seed."""
        for metric in subjects.recipe.metrics:
            for fabric, role in subjects.recipe.tested:
                for model in subjects.answering([fabric.name]):
                    yield cls.of(subjects, fabric, role, metric=metric, model=model)

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure one method after the other."""
        from reports.measure.held_out import measure_added

        rows = self.held_out(out)
        return [measure_added(method, self.metric, rows, self.errors.seed) for method in self.model.methods(out)]


class AtExtremes(Measurement):
    """All methods of a model at extreme sizes, angles and places, trained ones in half precision too."""

    kind: Literal["extremes"] = "extremes"
    code: ClassVar = ("truth", "extremes")
    model: Trained
    fabrics: tuple[tuple[Uncoloured, options.Role], ...]  # one fabric of each role
    truth: TruthOptions  # the recipe's physics, at a fixed precision

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a model and seed, on the first fabric of each role that it answers for."""
        truth = options.EXTREME_TRUTH.model_copy(update=subjects.recipe.physics)
        for model in subjects.models:
            known: dict[options.Role, Fabric] = {}
            for fabric, role in subjects.fabrics:
                if model.on([fabric.name]):
                    known.setdefault(role, fabric)
            if trained := model.on([fabric.name for fabric in known.values()]) if known else None:
                yield cls(model=trained, fabrics=tuple((fabric, role) for role, fabric in known.items()), truth=truth)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return 0.6 + self.model.seconds(0.0, len(self.fabrics))

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure all methods side by side."""
        from pipeline.models.added.guarded import unchecked
        from pipeline.models.runtimes import runs
        from reports.measure.extremes import lustrous, measure_extremes

        fabrics = list(self.fabrics)
        if not self.model.options.of_one_material:
            fabrics.append((lustrous(fabrics[0][0]), "unseen"))
        precisions = options.EXTREME_PRECISIONS if self.model.networks else ()
        families = [[unchecked(method), *runs(method, precisions)] for method in self.model.methods(out)]
        return measure_extremes(families, fabrics, self.truth)


class Latents(Measurement):
    """Answers between pairs of presets, and the time of edits; of an encoder, its errors by the samples it is given."""

    kind: Literal["latents"] = "latents"
    timed: ClassVar = True
    code: ClassVar = ("truth", "bench")
    model: Trained
    presets: tuple[Uncoloured, ...]  # presets of the pairs
    queries: QueryOptions
    truth: TruthOptions

    @classmethod
    def planned(cls, subjects: Subjects) -> Iterator[Measurement]:
        """Yield one a model that blends latents or encodes samples, trained with its first seed."""
        names = sorted({name for first, second, _ in options.LATENT_PAIRS for name in (first, second)})
        dataset, (*_, (last, _)) = subjects.recipe.dataset, subjects.fabrics
        for model in subjects.models if subjects.recipe.bench.latents else ():
            if model.is_first and (model.options.blends or model.options.encodes):
                presets = tuple(map(load_fabric, names)) if model.options.blends else (last, subjects.fabrics[0][0])
                yield cls(model=model, presets=presets, queries=dataset.queries, truth=dataset.truth)

    @property
    def cost(self) -> float:
        """Estimated seconds on one core."""
        return 60.0 if self.model.options.encodes else 10.0

    def measure(self, out: Path, progress: Progress) -> list[Record]:
        """Measure edits, then one pair after the other; or an encoder."""
        from reports.measure.encodings import measure_encodings
        from reports.measure.latents import measure_edits, measure_paths, pairs

        (method,) = self.model.methods(out)
        if self.model.options.encodes:
            encoder: Any = method
            fabric, other = self.presets
            return measure_encodings(encoder, fabric, other, self.truth)
        chosen = pairs()
        records = measure_edits(method, chosen[0].first)
        for index, pair in enumerate(chosen, start=1):
            records += measure_paths(method, pair, self.queries, self.truth)
            progress(index / len(chosen))
        return records
