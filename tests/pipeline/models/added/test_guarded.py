import pickle
from pathlib import Path

import numpy as np
import pytest

from pipeline.models.added.added_code import AddedFunction, AddedMethod
from pipeline.models.added.guarded import Guarded, MethodFailed, load_added, load_function, unchecked
from pipeline.models.added.source import locate
from pipeline.models.method import Method
from tests.pipeline.models.stand_ins import FakeMethod
from tests.pipeline.truth.cloths import equal_queries
from weaves.errors import BadInput
from weaves.fabric import load_fabric

OPTIONS = AddedMethod(name="theirs", source="/theirs.py:Theirs", sha256="0" * 64, stated="1", setting="k = 2")
DENIM = load_fabric("denim")


class Theirs(FakeMethod):
    def covers(self, fabric):
        return 1

    def prepare(self, fabric):
        raise RuntimeError("no table\nof two lines")

    def bytes_stored(self, fabric):
        return self.answers(None)


def rows(count=3):
    return equal_queries([0, 0, 1], [0, 0, 1], rows=count)


def guarded(answers):
    """Return the method that answers with an array, an error, or what a function returns."""

    def answer(queries):
        if isinstance(answers, BaseException):
            raise answers
        return answers(queries) if callable(answers) else answers

    return Guarded(Theirs(answer), OPTIONS, Path("/theirs.py"))


def some(value, row=1):
    answers = np.ones((3, 4), np.float32)
    answers[row, 2] = value
    return answers


def changed(queries):
    queries.u[0] = 5
    return some(1)


@pytest.mark.parametrize(
    ("answers", "sentence"),
    [
        ([[0, 0, 0, 0]] * 3, "list; a NumPy array is needed"),
        (some(1)[:2], "float32 (2, 4); float32 (3, 4) is needed"),
        (some(1).astype(np.float64), "float64 (3, 4); float32 (3, 4) is needed"),
        (some(np.nan), "1 of 3 rows with values that are not finite (first row 1: [ 1. 1. nan 1.])"),
        (some(-1e-9), "1 of 3 rows with values that are negative (first row 1"),
        (changed, "changed the arrays of its queries"),
        (ValueError("no such cloth"), "predict: ValueError: no such cloth"),
        (SystemExit(0), "predict: SystemExit"),
        (BadInput("queries", "wi", 1, "too steep"), "predict: BadInput: queries: wi = 1: too steep"),
    ],
)
def test_a_fault_of_predict_is_a_sentence_with_the_name(answers, sentence):
    with pytest.raises(MethodFailed) as failure:
        guarded(answers).predict(DENIM, rows())
    assert str(failure.value).startswith("theirs: predict") and sentence in str(failure.value)
    assert "\n" not in str(failure.value)


def test_sound_answers_are_those_of_the_method_and_wrong_values_for_those_who_count_them():
    answers = some(0)
    method = guarded(answers)
    assert method.predict(DENIM, rows()) is answers
    assert isinstance(method, Method) and (method.name, method.setting) == ("theirs", "k = 2")
    assert method.covers(DENIM) is True
    assert guarded(some(1)[:0]).predict(DENIM, rows(0)).shape == (0, 4)
    assert guarded(np.int64(12)).bytes_stored(DENIM) == 12
    method = unchecked(guarded(some(np.nan)))
    assert np.isnan(method.predict(DENIM, rows())).sum() == 1
    with pytest.raises(MethodFailed, match="is needed"):
        unchecked(guarded(some(1)[:2])).predict(DENIM, rows())
    other = Theirs(None)
    assert unchecked(other) is other


@pytest.mark.parametrize("wrong", [-1, 2.5, True, None, "8", 2**63, 10**5000], ids=range(7))
def test_bytes_are_an_integer_and_faults_name_their_function(wrong):
    with pytest.raises(MethodFailed, match=r"an integer from 0 to 2\^63 - 1 is needed"):
        guarded(wrong).bytes_stored(DENIM)
    with pytest.raises(MethodFailed, match=r"^theirs: prepare: RuntimeError: no table of two lines$"):
        guarded(wrong).prepare(DENIM)


def test_code_that_is_not_the_planned_one_is_refused_and_failures_cross_processes(tmp_path):
    failure = pickle.loads(pickle.dumps(MethodFailed("theirs", "too late")))
    assert (failure.name, failure.reason, str(failure)) == ("theirs", "too late", "theirs: too late")
    path = tmp_path / "theirs.py"
    path.write_text("raise RuntimeError('this must not run')")
    options = OPTIONS.model_copy(update={"source": f"{path}:Theirs"})
    with pytest.raises(MethodFailed, match=r"SHA-256 is .* on this machine, and 000000000000… was planned"):
        load_added(options)
    path.unlink()
    with pytest.raises(MethodFailed, match=r"^theirs: .*there is no file"):
        load_added(options)


@pytest.mark.parametrize(
    ("body", "found"),
    [
        ("sum(given)", 6.0),
        ("__import__('numpy').float32(0.5)", 0.5),
        ("float('nan')", "theirs: it returned nan; a finite number is needed"),
        ("None", "theirs: it returned None; a finite number is needed"),
        ("10**5000", "theirs: the metric: OverflowError: int too large to convert to float"),
        ("1 / 0", "theirs: the metric: ZeroDivisionError: division by zero (metrics.py, line 2)"),
    ],
)
def test_a_metric_is_a_number_or_fails_in_a_sentence(tmp_path, body, found):
    path = tmp_path / "metrics.py"
    path.write_text(f"def theirs(*given):\n    return {body}\n")
    source = locate(f"{path}:theirs")
    fields = {"title": "t", "definition": "d", "unit": "1", "better": "lower", "format": "percent", "stated": "1"}
    metric = load_function(AddedFunction(name="theirs", source=source.text, sha256=source.sha256(), **fields))
    try:
        assert metric(1, 2, 3) == found
    except MethodFailed as failure:
        assert str(failure) == found
