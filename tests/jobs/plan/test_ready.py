"""Order in which tasks start, compared with the definition by sorting all ready tasks each time."""

from typing import ClassVar

from hypothesis import given, settings
from hypothesis import strategies as st

from jobs.plan.ready import Ready, chains
from jobs.plan.task import Task


class Step(Task):
    stage: ClassVar = "generate"

    name: int
    seconds: float = 1.0
    after: tuple[str, ...] = ()

    @property
    def needs(self):
        return self.after

    @property
    def cost(self):
        return self.seconds

    def versions(self):
        return {}


class Alone(Step):
    slots: ClassVar = "all"


@st.composite
def plans(draw):
    tasks = []
    for name in range(draw(st.integers(1, 8))):
        kind = draw(st.sampled_from([Step, Step, Alone]))
        needs = draw(st.lists(st.sampled_from([task.id for task in tasks] or ["absent"]), max_size=3, unique=True))
        needs = [need for need in needs if need != "absent"]
        tasks.append(kind(name=name, seconds=draw(st.integers(1, 5)), after=tuple(needs)))
    return tasks


@given(plans(), st.integers(1, 3), st.randoms(use_true_random=False))
@settings(max_examples=150, deadline=None)
def test_tasks_start_as_if_all_were_sorted_at_every_end(tasks, slots, random):
    ready, urgency = Ready(tasks, []), chains(tasks, {task.id: task.cost for task in tasks})
    done, waiting, running = set(), {task.id: task for task in tasks}, {}
    while waiting or running:
        taken = ready.take(slots)
        for task in taken:
            able = [other for other in waiting.values() if done.issuperset(other.needs)]
            assert task in able
            if task.slots == "all":
                assert not running and all(other.slots == "all" for other in able)
            else:
                assert len(running) < slots and not any(other.slots == "all" for other in running.values())
            assert urgency[task.id] == max(urgency[other.id] for other in able if other.slots == task.slots)
            running[task.id] = waiting.pop(task.id)
        # No slot stays free that a task could have.
        able = [other for other in waiting.values() if done.issuperset(other.needs)]
        if len(running) < slots and not any(other.slots == "all" for other in running.values()):
            assert not [other for other in able if other.slots == "one"]
        assert running
        task = random.choice(list(running.values()))
        del running[task.id]
        if random.choice([True, False]):
            ready.free(task)
            assert task.id not in {other.id for other in ready.running}
        match random.choice(["finish", "finish", "again", "fail"]):
            case "finish":
                ready.finish(task)
                done.add(task.id)
            case "again":
                ready.again(task)
                waiting[task.id] = task
            case "fail":
                ready.free(task)
                # What needs it, directly or not, stays behind.
                lost = {task.id}
                for other in tasks:
                    if lost.intersection(other.needs):
                        lost.add(other.id)
                waiting = {id: other for id, other in waiting.items() if id not in lost}
        assert {other.id for other in ready.running} == set(running)
        assert {other.id for other in ready.waiting} >= set(waiting)


def test_a_free_slot_is_filled_before_the_task_that_ended_is_done():
    first, other, alone = Step(name=1, seconds=9.0), Step(name=2), Alone(name=3)
    after = Step(name=4, after=(first.id,))
    ready = Ready([first, other, alone, after], [])
    assert ready.take(1) == [first]
    ready.free(first)
    assert ready.take(1, alone=False) == [other]  # what needs the first still waits
    ready.finish(first)
    ready.free(other)
    ready.free(other)
    assert ready.take(1, alone=False) == [after]
    ready.finish(after)
    assert ready.take(1, alone=False) == [] and ready.take(1) == [alone]


def test_a_task_that_is_opened_again_comes_first_and_holds_back_what_needs_it():
    first, other = Step(name=1), Step(name=2, seconds=9.0)
    after = Step(name=3, after=(first.id,))
    ready = Ready([other, after], [first.id])
    assert ready.take(2) == [other, after]
    ready.again(after)  # it found that the products of the first are damaged
    ready.reopen(first)
    assert ready.take(2) == [first]
    ready.finish(first)
    assert ready.take(2) == [after] and not ready.waiting
    ready.finish(after)


def test_a_task_that_was_done_before_waits_for_its_needs_when_both_are_opened_again():
    first = Step(name=1)
    second = Step(name=2, after=(first.id,))
    third = Step(name=3, after=(second.id,))
    ready = Ready([third], [first.id, second.id])
    ready.reopen(second)
    ready.reopen(first)
    for task in (first, second, third):
        assert ready.take(9) == [task]
        ready.finish(task)


def test_what_needs_a_lost_task_waits_for_ever():
    first = Step(name=1)
    after = Step(name=2, after=(first.id,))
    ready = Ready([after], [first.id])
    ready.lose(first)
    assert not ready.take(9) and ready.waiting == [after]


def test_the_longest_chain_is_the_most_urgent():
    short, long = Step(name=1), Step(name=2)
    after = Step(name=3, after=(long.id, "done before"))
    seconds = {short.id: 5, long.id: 1, after.id: 30}
    assert chains([short, long, after], seconds) == {short.id: 5, long.id: 31, after.id: 30}
