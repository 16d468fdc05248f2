"""Answers as a file: the numbers of the method that gave them, its place on the page, and what is refused."""

import shutil

import numpy as np
import pytest

import jobs.verbs.run
from jobs.plan.measurements.answers import OfAnswers
from jobs.plan.page import Page
from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from pipeline.models.analytic.prefiltered import PrefilteredOptions
from pipeline.scenes.shade import coloured, colours_of
from pipeline.shards.entry_files import write_answers
from reports.measure.by_size import measure_errors_by_size
from reports.measure.held_out import held_out, measure_errors
from reports.record import Record, read_records
from reports.tables.number_format import percent
from reports.tables.page_tables import page_frames, result_tables
from tests.jobs import made_up
from tests.jobs.test_bad_inputs import KINDS
from tests.refusals import ends, refusal


@pytest.fixture
def out(tmp_path, recipe):
    made_up.finished(recipe, tmp_path / "out", ["generate"])
    return tmp_path / "out"


def done(recipe, folder, out):
    """Return the task that measures an entry, when it is done."""
    (task,) = (one for one in plan(load_recipe(recipe, [str(folder / "entry.toml")])) if isinstance(one, OfAnswers))
    task.run(out, lambda share: None)
    assert all((out / path).is_file() for path in task.products)
    return task


def measured(recipe, folder, out):
    return read_records([out / done(recipe, folder, out).records])


def held_out_rows(recipe, out):
    """Return the rows in the order of the questions."""
    loaded = load_recipe(recipe)
    task = next(one for one in plan(loaded) if hasattr(one, "dataset"))
    manifest = task.dataset.manifest(out)
    return [held_out(manifest, out / task.dataset.folder, fabric.name) for fabric, _ in loaded.tested]


def numbers(records, metrics=None):
    """Return what Records measure, without names."""
    chosen = [record for record in records if metrics is None or record.metric in metrics]
    return [(r.fabric, r.metric, r.value, r.standard_error, r.low, r.high, r.curve, r.count) for r in chosen]


def test_answers_in_a_file_have_the_numbers_of_the_method_that_gave_them(recipe, entry, out):
    (method,) = PrefilteredOptions().methods()
    rows, own, answers = held_out_rows(recipe, out), [], []
    for part in rows:
        method.prepare(part.fabric)
        own += measure_errors(method, part, 0)
        answers.append(method.predict(part.fabric, part.queries))
    own += measure_errors_by_size([method], rows[:2], 0)
    records = measured(recipe, entry(np.concatenate(answers)), out)
    stated = [record for record in records if record.metric.startswith("stated_")]
    assert numbers(records[: -len(stated)]) == numbers(own) and len(own) > 30
    roles = {record.fabric: record.role for record in records if record.metric == "mse"}
    assert roles == {"denim": "seen", "voile": "unseen", **{part.fabric.name: "unseen" for part in rows[2:]}}
    assert {r.metric: r.value for r in stated} == {
        "stated_time": 120.0, "stated_bytes": 5000, "stated_multiply_adds": 900, "stated_tries": 1
    }  # fmt: skip
    (origin,) = {record.provenance.origin for record in records}
    assert "answers by Ada Weaver, version 3f2a, without code" in origin


def test_answers_in_colour_have_the_same_mse_and_no_error_of_components(recipe, entry, out):
    rows, chance = held_out_rows(recipe, out), np.random.default_rng(1)
    components = [chance.random((len(part.queries.u), 4)).astype(np.float32) for part in rows]
    rgb = [coloured(c, colours_of(part.fabric, part.queries)) for c, part in zip(components, rows, strict=True)]
    errors = ("mse", "mse_measured", "truth_noise")
    first = numbers(measured(recipe, entry(np.concatenate(components)), out), errors)
    records = measured(recipe, entry(np.concatenate(rgb).astype(np.float32), "in_colour"), out)
    second = numbers(records, errors)
    assert [one[:2] for one in first] == [one[:2] for one in second]
    np.testing.assert_allclose([one[2] for one in first], [one[2] for one in second], rtol=1e-6)
    stated = {f"stated_{name}" for name in ("time", "bytes", "multiply_adds", "tries")}
    assert {record.metric for record in records} == {*errors} | stated


def test_an_entry_is_a_row_of_the_page_and_what_it_states_is_marked(recipe, entry, out):
    folder = entry(source="https://example.org/code", each_fabric=True)
    loaded = load_recipe(recipe, [str(folder / "entry.toml")])
    (page,) = (task for task in plan(loaded) if isinstance(task, Page))
    assert [note.name for note in page.models] == ["prefiltered", "theirs"] and page.models[1].per_material
    assert "costs are stated, not measured" in page.models[1].about
    records = measured(recipe, folder, out)
    tables = result_tables(records, page_frames(records), {}, ["theirs"])
    seen, unseen, *_ = (table for table in tables["error"] if table.title.startswith("Errors"))
    assert [row.label for row in (*seen.rows, *unseen.rows)] == ["theirs", "theirs *"]
    (table,) = tables["entries"]
    assert table.markdown().splitlines()[-1] == (
        "| theirs | ≤ 16 k | 120 | 5.0 kB | 900 | 1 | an old laptop, threads: 2 | none | https://example.org/code, "
        "version 3f2a |"
    )


def test_errors_by_size_of_an_entry_are_shown_without_a_time(recipe, entry, out):
    records = measured(recipe, entry(), out)
    (own,) = (record for record in records if record.metric == "size_colour")
    for setting, ns in (("k = 1", 100.0), ("k = 2", 200.0)):
        rival = Record(method="point_sampled", setting=setting)
        curve = tuple((edge, ns) for edge, _ in own.curve)
        records += [rival.of("size_time", ns, 1, curve=curve)]
        records += [rival.of(f"size_{part}", 0.5, 1, curve=own.curve) for part in ("colour", "specular", "diffuse")]
    colour, _ = result_tables(records, page_frames(records), {})["equal-time"]
    (row,) = colour.rows
    errors = [cell.text.split(" · ") for cell in row.cells[1:]]
    assert (row.method, str(row.cells[0])) == ("theirs", "points") and {other for _, other in errors} == {"–"}
    assert [error for error, _ in errors] == [percent(value) for value in (*dict(own.curve).values(), own.value)]


def test_an_entry_changes_no_other_task_but_the_page_and_goes_when_it_is_not_named(
    recipe, entry, call, monkeypatch, tmp_path
):
    monkeypatch.setattr(jobs.verbs.run, "execute", made_up.execute)
    folder = entry()
    before, after = ({task.id for task in plan(load_recipe(recipe, add))} for add in ([], [str(folder / "entry.toml")]))
    assert len(after - before) == 2 and len(before - after) == 1
    assert call("bench", recipe)[0] == call("bench", recipe, "--answers", folder)[0] == 0
    code, said, _ = call("prune", recipe, "--answers", folder)
    assert code == 0 and "nothing to remove" in said
    code, said, _ = call("prune", recipe, "--delete")
    assert code == 0 and "entries 4" in said and "5 files removed" in said
    assert not list((tmp_path / "out").glob("entries/*"))


def test_the_copy_is_the_same_entry(recipe, entry, out):
    task = done(recipe, entry(), out)
    copy = out / task.products[-2]
    assert [one.id for one in plan(load_recipe(recipe, [str(copy)])) if isinstance(one, OfAnswers)] == [task.id]


def test_bad_entries_are_refused_before_anything_is_written(recipe, entry, refused, tmp_path):
    folder = entry()

    def sentence(*more):
        return refused("bench", recipe, "--answers", folder, *more)

    write_answers(folder / "answers.parquet", np.full((255, 4), 0.1, np.float32))
    assert "the id 255 is missing: 1 of 256 questions have no answer" in sentence()
    (folder / "answers.csv").touch()
    assert "one of them is needed" in sentence()
    for path in folder.glob("answers.*"):
        path.unlink()
    assert "lacks answers.parquet and answers.csv" in sentence()
    for key, value in (
        ("name", "prefiltered"), ("name", "a b"), ("authors", ""), ("authors", "a | b"), ("machine", "x\n## y"),
        ("nanoseconds", 0), ("nanoseconds", float("nan")), ("threads", 1.5), ("bytes_stored", -1), ("tries", 0),
        ("questions", "0" * 16), ("each_fabric", "no"), ("watts", 3),
    ):  # fmt: skip
        folder = entry(**{"name": "theirs", key: value} if key == "name" else {key: value})
        assert f"{key} = " in sentence()
    folder = entry()
    assert "is the name of a model or of another entry" in sentence("--answers", folder)
    (folder / "entry.toml").unlink()
    assert "entry.toml" in sentence()
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["entry.toml", "answers.parquet", "answers.csv"])
def test_a_broken_file_of_an_entry_is_one_sentence(name, recipe, entry):
    for kind, write in KINDS.items():
        folder = entry()
        if name == "answers.csv":
            (folder / "answers.parquet").unlink()
        (folder / name).unlink(missing_ok=True)
        write(folder / name)
        with ends():
            assert folder.name in refusal(load_recipe, recipe, [str(folder / "entry.toml")]), kind
        shutil.rmtree(folder)


def test_questions_change_with_what_is_right_and_not_with_how_exactly_it_is_known(tmp_path):
    def known(**dataset):
        return load_recipe(made_up.write_recipe(tmp_path, "tiny", **dataset)).questions

    first, plane = known(), {"parallax": False}
    assert known(truth={"relative_error": 0.5}) == known(rows={"train": 1, "test": 64}) == first
    others = [known(seed=1), known(seen=["voile"]), known(rows={"train": 1, "test": 65})]
    others.append(known(truth=plane, bench=dict.fromkeys(("truth", "frame_truth"), plane)))
    assert len({first, *others}) == 5
