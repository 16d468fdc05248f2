import pytest

from jobs.plan.part import Part
from tests.refusals import refusal

NO_PARTS = ["0/1000", "1001/1000", "x/y", "5/0", "", "3", "1/2/3", "-1/2", "1.0/2", "01/2", " 1/2", "1/2\n", "٣/٤"]


@pytest.mark.parametrize("text", [*NO_PARTS, f"1/{10**9}", "9" * 5000 + "/1"])
def test_a_text_that_names_no_part_is_bad_input(text):
    assert "must be a number, a slash and the number of parts" in refusal(Part.read, text)


@pytest.mark.parametrize("stage", ["generate", "train", "bench"])
def test_each_task_that_waits_for_no_other_of_its_stage_is_in_exactly_one_part(files, stage):
    tasks = files.plan()
    whole = [task.id for task in Part(1, 1).of(tasks, stage)]
    for parts in (1, 2, 3, 7, len(whole) + 5):
        named = [Part.read(f"{number}/{parts}") for number in range(1, parts + 1)]
        shares = [[task.id for task in part.of(tasks, stage)] for part in named]
        assert sorted(id for share in shares for id in share) == sorted(whole)
        assert max(map(len, shares)) - min(map(len, shares)) <= 1
    rest = [task for task in tasks if task.stage == stage and task.id not in whole]
    own = {task.id for task in tasks if task.stage == stage}
    assert all(task.timed or own & set(task.needs) for task in rest)
    assert bool(rest) == (stage == "bench")
