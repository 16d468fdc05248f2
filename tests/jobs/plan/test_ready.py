"""Order in which tasks start, compared with the definition by sorting all ready tasks each time."""

import math
from typing import ClassVar

from hypothesis import given, settings
from hypothesis import strategies as st

from jobs.plan.ready import Ready, chains
from tests.jobs.fake_stages import Fake


class Step(Fake):
    seconds: float = 1.0

    @property
    def cost(self):
        return self.seconds


class Alone(Step):
    slots: ClassVar = "all"


@st.composite
def plans(draw):
    """Draw tasks in the order of need, and the ids of those that are done before."""
    tasks = []
    for name in range(draw(st.integers(1, 8))):
        kind = draw(st.sampled_from([Step, Step, Alone]))
        needs = draw(st.sets(st.sampled_from([task.id for task in tasks]), max_size=3)) if tasks else ()
        tasks.append(kind(name=str(name), seconds=draw(st.integers(1, 5)), after=tuple(needs)))
    return tasks, {task.id for task in tasks if draw(st.integers(0, 3)) == 3}


@given(plans(), st.integers(1, 3), st.randoms(use_true_random=False))
@settings(max_examples=100)
def test_tasks_start_as_if_all_were_sorted_at_every_end(drawn, slots, random):
    tasks, done = drawn
    todo = [task for task in tasks if task.id not in done]
    ready, urgency = Ready(todo, done), chains(todo, {task.id: task.cost for task in todo})
    waiting, running = {task.id: task for task in todo}, {}

    def able(slots):
        return [task for task in waiting.values() if task.slots == slots and done.issuperset(task.needs)]

    def start(alone):
        for task in ready.take(slots, alone):
            assert task in able(task.slots)
            if task.slots == "all":
                assert alone and not running and not able("one")
            else:
                assert len(running) < slots and not any(other.slots == "all" for other in running.values())
            assert urgency[task.id] == max(urgency[other.id] for other in able(task.slots))
            running[task.id] = waiting.pop(task.id)
        # No slot stays free that a task could have.
        if len(running) < slots and not any(other.slots == "all" for other in running.values()):
            assert not able("one")
        assert running or not alone or not able("all")
        assert [{task.id for task in some} for some in (ready.running, ready.waiting)] == [{*running}, {*waiting}]

    start(True)
    while running:
        task = random.choice([*running.values()])
        del running[task.id]
        if random.choice([True, False]):
            ready.free(task)  # its slot is free before it is done
            start(random.choice([True, False]))
        match random.choice(["finish", "finish", "finish", "again", "fail"]):
            case "finish":
                ready.finish(task)
                done.add(task.id)
            case "again":
                ready.again(task)
                waiting[task.id] = task
            case "fail":
                ready.free(task)  # what needs it stays behind
        if done and random.choice([False, True]):  # its products are damaged
            task = random.choice([task for task in tasks if task.id in done])
            done.remove(task.id)
            if random.choice([True, False]):
                ready.reopen(task)
                waiting[task.id], urgency[task.id] = task, math.inf
            else:
                ready.lose(task)
        start(True)
