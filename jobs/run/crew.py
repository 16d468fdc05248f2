"""Crew: the workers of a scheduler, their software, and the tasks that are with them; or this process alone.

Workers may come and go while a run is under way, as those of a cluster that adapts do. One whose software is not the
driver's is refused: each new worker is checked before it counts, and a task that dask hands to one before that is not
computed there.
"""

import hashlib
import platform
import time
import uuid
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from http.client import HTTPException
from importlib import metadata
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, ClassVar, Final
from urllib.request import ProxyHandler, build_opener

from jobs.plan.task import Task
from jobs.run.compiling import KernelGroup
from jobs.run.ledger import Ledger
from jobs.run.outcome import Outcome, work
from jobs.run.receipt import Product
from pipeline import patience
from pipeline.storage import place
from weaves.errors import WorkFailed

_SECONDS_BETWEEN_LOOKS: Final = 1.0
_SECONDS_BETWEEN_SIGNS: Final = 0.2
_SECONDS_FOR_AN_ANSWER: Final = 5.0
_SECONDS_OF_SILENCE: Final = 5.0  # between two looks while kernels are compiled


class Crew:
    """The workers that may get tasks.

    Those of a scheduler of somebody else (`external`) are checked; those of this run have the driver's software. `hear`
    receives the messages of workers, a dictionary with ``task`` and ``share``, ``sentence``, or ``kernel``, from a
    thread of dask's.
    """

    def __init__(self, client: Any, external: bool, hear: Callable[[Mapping[str, Any]], None]) -> None:
        self._client, self._external, self._hear = client, external, hear
        self._threads: dict[str, int] = {}
        self._checked: dict[str, str] = {}  # what differs, by address; empty: nothing
        self._looked = -_SECONDS_BETWEEN_LOOKS
        self.accepted: list[str] = []  # addresses of the workers that may get tasks
        # Topic and keys of this run: another run of the same task, with another folder, is not this one.
        self._topic = f"twillight-{uuid.uuid4().hex}"
        self._number = 0
        self._running: dict[str, tuple[Task, Any]] = {}  # and their futures, by key
        self._begun: set[str] = set()  # ids
        # Keys with outcomes; without one: the future has ended. Filled by threads of dask's.
        self._ended: SimpleQueue[tuple[str, Mapping[str, Any] | None]] = SimpleQueue()
        client.subscribe_topic(self._topic, self._receive)
        self.look(now=True)

    def look(self, now: bool = False) -> None:
        """Ask the scheduler for its workers, once a second at most or `now`, and check those that are new.

        WorkFailed if every worker is refused.
        """
        if not now and time.monotonic() - self._looked < _SECONDS_BETWEEN_LOOKS:
            return
        self._threads = self._client.nthreads()
        self._looked = time.monotonic()
        self._checked = {address: why for address, why in self._checked.items() if address in self._threads}
        if new := [address for address in self._threads if address not in self._checked] if self._external else []:
            self._check(new)
        self.accepted = [address for address in self._threads if not self._external or self._checked.get(address) == ""]

    @property
    def slots(self) -> int:
        """Tasks that should be with the scheduler: one a thread.

        A scheduler of somebody else gets more, because a cluster that adapts grows only if it sees tasks that wait.
        """
        return 2 * self.threads + 2 if self._external else self.threads

    @property
    def threads(self) -> int:
        """Threads of the workers that may get tasks; 1 if there is none."""
        return max(1, sum(self._threads[address] for address in self.accepted))

    @property
    def dashboard(self) -> str | None:
        """Address of the dashboard of somebody else's scheduler; None if it has none that this machine can open."""
        if not self._external:
            return None
        try:
            address = str(self._client.dashboard_link)
            # A scheduler names an address also without a dashboard, and then has no page there.
            build_opener(ProxyHandler({})).open(address, timeout=_SECONDS_FOR_AN_ANSWER).close()
        except (KeyError, OSError, ValueError, HTTPException):
            return None
        return address

    def compile(self, groups: Sequence[KernelGroup], show: Callable[[int, Iterable[str]], None]) -> None:
        """Compile groups of kernels in all workers at once; `show` receives how many are done, and which are under way.

        A failure here occurs again in the task that needs the kernel, and is reported there.
        """
        from distributed import wait

        waiting, running = list(groups), dict[Any, str]()
        while waiting or running:
            self.look()
            while waiting and len(running) < self.threads:
                group = waiting.pop(0)
                future = self._client.submit(_compile, group, self._topic, pure=False, **self._where(()))
                running[future] = group.name
            show(len(groups) - len(waiting) - len(running), running.values())
            with suppress(TimeoutError):
                first = wait(list(running), timeout=_SECONDS_OF_SILENCE, return_when="FIRST_COMPLETED")  # type: ignore[no-untyped-call]
                for future in first.done:
                    del running[future]

    def start(self, task: Task, out: str, inputs: Mapping[str, str], avoided: Collection[str] = ()) -> None:
        """Give a task to a worker, not to one of `avoided` if there is a choice.

        Every worker must see the output folder as `out`; `inputs` are the hashes of the products that the task needs,
        by path.
        """
        self._number += 1  # a second try must not get the first one's result
        key = f"{task.stage}-{task.id}-{self._topic}-{self._number}"
        given = task, out, inputs, self._topic, software() if self._external else None
        future = self._client.submit(_work, *given, key=key, **self._where(avoided))
        self._running[key] = task, future
        future.add_done_callback(lambda future: self._ended.put((future.key, None)))

    def ended(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """Wait for a task to end, so many seconds at most; return all that have ended, with their outcomes."""
        outcomes: list[tuple[Task, Outcome]] = []
        try:
            key, content = self._ended.get(timeout=seconds)
            while True:
                if key in self._running:  # else its outcome came as a message, and now its future ends
                    task, future = self._running.pop(key)
                    outcomes.append((task, _outcome(content) if content else self._failure(task, future)))
                    self._begun.discard(task.id)
                key, content = self._ended.get_nowait()
        except Empty:
            return outcomes

    def recheck(self, address: str) -> None:
        """Check a worker again that did not accept a task, or look for another one."""
        if self._external and not self._checked.get(address):
            self._checked.pop(address, None)
            self.look(now=True)

    def _receive(self, event: tuple[float, Any]) -> None:
        message: Mapping[str, Any] = event[1]
        if "outcome" in message:
            self._ended.put((message["key"], message["outcome"]))
            return
        if "task" in message:
            self._begun.add(message["task"])
        self._hear(message)

    def _failure(self, task: Task, future: Any) -> Outcome:
        """Return the outcome of a task that ended without a message.

        Dask blames the death of a worker on all tasks that were with it; one that had not begun is innocent.
        """
        from distributed import KilledWorker

        error = future.exception(timeout=_SECONDS_FOR_AN_ANSWER)
        if isinstance(error, KilledWorker):
            if task.id not in self._begun:
                return Outcome(reason="its worker died before it began", refused=True)
            return Outcome(reason="the process that ran it was killed several times over; is there enough memory?")
        return Outcome.failed(error or RuntimeError("its worker sent no outcome"))

    def _where(self, avoided: Collection[str]) -> dict[str, Any]:
        """Return the arguments of `Client.submit` that keep a task from refused and from `avoided` workers."""
        preferred = [address for address in self.accepted if address not in avoided]
        if not preferred or len(preferred) == len(self._threads):
            return {}
        # A preference: a task bound to these alone would wait for ever when they have left.
        return {"workers": preferred, "allow_other_workers": True}

    def _check(self, new: list[str]) -> None:
        for address, there in self._client.run(software, workers=new, on_error="return").items():
            if isinstance(there, OSError):
                continue  # it is gone, or the next look queries it again
            self._checked[address] = _difference(there)
            if self._checked[address]:
                self._hear({"sentence": self._refusal(address)})
        if self._threads and all(self._checked.get(address) for address in self._threads):
            raise WorkFailed(f"every worker is refused; {self._refusal(next(iter(self._checked)))}")

    def _refusal(self, address: str) -> str:
        return f"worker {address} gets no task: {self._checked[address]}; install the same version there"


class Serial:
    """Tasks one after the other in this process, with the interface of `Crew`: no scheduler and no port.

    Other processes may be at work in the output folder: a task that one of them is at is waited for, and taken from it.
    Tasks that measure time and code from outside have processes of their own, as always (`jobs.run.outcome`).
    """

    slots: ClassVar[int] = 1
    dashboard: ClassVar[str | None] = None

    def __init__(self, ledger: Ledger, hear: Callable[[Mapping[str, Any]], None]) -> None:
        self._ledger, self._hear = ledger, hear
        self._next: list[tuple[Task, Mapping[str, str]]] = []
        self.accepted = ["this process"]

    def look(self) -> None:
        """Do nothing: no worker comes or goes."""

    def recheck(self, address: str) -> None:
        """Do nothing: its software is the driver's."""

    def compile(self, groups: Sequence[KernelGroup], show: Callable[[int, Iterable[str]], None]) -> None:
        """Compile groups of kernels; a failure here occurs again in the task that needs the kernel."""
        for done, group in enumerate(groups):
            show(done, [group.name])
            with suppress(Exception):
                group.compile(lambda kernel: self._hear({"kernel": kernel}))

    def start(self, task: Task, out: str, inputs: Mapping[str, str], avoided: Collection[str] = ()) -> None:
        """Take a task that `ended` does; arguments as for a crew, and the folder is that of the ledger."""
        self._next.append((task, inputs))

    def ended(self, seconds: float) -> list[tuple[Task, Outcome]]:
        """Do the task that was started, and return it with its outcome."""
        task, inputs = self._next.pop()
        with self._ledger.store.claimed(task.id):
            if receipt := self._ledger.done(task):
                return [(task, Outcome(receipt.files, receipt.seconds))]
            hear = self._hear
            return [(task, work(task, self._ledger.out, lambda share: hear({"task": task.id, "share": share}), inputs))]


def _difference(there: Mapping[str, str] | BaseException) -> str:
    """Return how a worker's software differs from this process's, in words; empty if it does not."""
    if isinstance(there, BaseException):
        return f"it has no twillight of this version ({type(there).__name__})"
    pairs = ((name, there.get(name, "missing"), here) for name, here in software().items())
    words = [f"{name} {other} (here {here})" for name, other, here in pairs if other != here]
    return f"it has {', '.join(words)}" if words else ""


def _compile(group: KernelGroup, topic: str) -> None:
    from distributed import get_worker

    worker = get_worker()
    group.compile(lambda kernel: worker.log_event(topic, {"kernel": kernel}))


def _work(task: Task, out: str, inputs: Mapping[str, str], topic: str, expected: dict[str, str] | None) -> None:
    """Do a task in a worker, unless its software is not the `expected` one, and send the outcome as a message.

    A message costs less than a result that dask gathers, and is not lost if the worker dies after it.
    """
    from distributed import get_worker

    worker, last = get_worker(), time.monotonic()

    def progress(share: float) -> None:
        nonlocal last
        if (now := time.monotonic()) - last >= _SECONDS_BETWEEN_SIGNS:
            worker.log_event(topic, {"task": task.id, "share": float(share)})
            last = now

    patience.tell(lambda sentence: worker.log_event(topic, {"sentence": sentence}))
    if expected and expected != software():
        outcome = Outcome(reason="its worker has other software than the driver", refused=True)
    else:
        worker.log_event(topic, {"task": task.id, "share": 0.0})
        outcome = work(task, place(out), progress, inputs, worker.state.nthreads)
    files = {name: product.model_dump() for name, product in outcome.files.items()}
    content = outcome._asdict() | {"files": files, "worker": worker.address}
    worker.log_event(topic, {"key": worker.get_current_task(), "outcome": content})


def _outcome(content: Mapping[str, Any]) -> Outcome:
    files = {name: Product(**product) for name, product in content["files"].items()}
    return Outcome(**{**content, "files": files})


@cache
def software() -> dict[str, str]:
    """Return the versions of this process: the hash of twillight's sources, Python, and the libraries that compute.

    Builds of PyTorch for different devices (``+cpu``, ``+cu126``) count as one version.
    """
    root, sources = Path(__file__).parents[2], hashlib.sha256()
    packages = [root / name for name in ("weaves", "pipeline", "reports", "jobs")]
    for path in sorted(path for package in packages for path in package.rglob("*.py")):
        sources.update(f"{path.relative_to(root).as_posix()}\0".encode())
        sources.update(hashlib.sha256(path.read_bytes()).digest())
    python = ".".join(platform.python_version_tuple()[:2])
    libraries = {name: metadata.version(name).partition("+")[0] for name in ("numba", "numpy", "torch")}
    return {"twillight's sources": sources.hexdigest()[:8], "Python": python, **libraries}
