import pytest

from jobs.plan.plan import plan
from jobs.recipe.load import load_recipe
from jobs.run.compiling import kernel_groups


@pytest.fixture(scope="module")
def tasks():
    return plan(load_recipe("quick"))


def names(tasks):
    return {group.name for group in kernel_groups(tasks)}


def test_a_task_asks_for_what_it_uses_alone_and_each_group_is_compiled_once_whatever_the_options(tasks):
    assert names(task for task in tasks if task.stage == "generate") == {"auto"}
    assert names(task for task in tasks if task.stage in ("train", "report")) <= {"soft_nodes"}
    assert names(t for t in tasks if t.title == "extremes of prefiltered") == {"owen", "prefiltered"}
    groups = {group.name: group for group in kernel_groups(tasks)}
    assert len(groups) == len(kernel_groups(tasks))
    groups["prefiltered"].compile(lambda kernel: None)
    groups["prefiltered"].compile(pytest.fail)  # nothing is left to be announced
    usual = {group.name: group.model for group in kernel_groups(plan(load_recipe("standard")))}
    assert usual["soft_nodes"].levels == [8]  # level 0 has no nodes on lines
