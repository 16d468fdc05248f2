"""Workers of a scheduler: how many threads they have, and which are refused because their software is another.

Workers may come and go while a run is under way, as those of a cluster that adapts do. Each new one is checked before
it counts. A task that dask hands to a worker before it was checked is not computed there (`jobs.run.executor`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from typing import Any, Final

from jobs.run.software import difference, digest, software
from weaves.errors import WorkFailed

_SECONDS_BETWEEN_LOOKS: Final = 1.0


class Workers:
    """The workers that may get tasks.

    Parameters
    ----------
    client : distributed.Client
        Client of the scheduler.
    external : bool
        True for a scheduler of somebody else: its workers are checked. Those of this run have the driver's software.
    say : callable
        Receives a sentence for each refused worker.
    """

    def __init__(self, client: Any, external: bool, say: Callable[[str], None]) -> None:
        self._client, self._external, self._say = client, external, say
        self._threads: dict[str, int] = {}
        self._checked: dict[str, str] = {}  # what differs, by address; empty: nothing
        self._looked = -_SECONDS_BETWEEN_LOOKS
        self.accepted: list[str] = []
        """Addresses of the workers that may get tasks."""
        self.digest = digest() if external else ""
        """Hash of the software that workers must have; empty: any."""

    def look(self, now: bool = False) -> None:
        """Ask the scheduler for its workers, once a second at most or `now`, and check those that are new.

        Raises
        ------
        WorkFailed
            If every worker is refused.
        """
        if not now and time.monotonic() - self._looked < _SECONDS_BETWEEN_LOOKS:
            return
        self._threads = self._client.nthreads()
        self._looked = time.monotonic()
        self._checked = {address: found for address, found in self._checked.items() if address in self._threads}
        if new := [address for address in self._threads if address not in self._checked] if self._external else []:
            self._check(new)
        self.accepted = [one for one in self._threads if not self._external or self._checked.get(one) == ""]

    @property
    def slots(self) -> int:
        """Tasks that should be with the scheduler: one a thread.

        A scheduler of somebody else gets more, because a cluster that adapts grows only if it sees tasks that wait.
        """
        return 2 * self.threads + 2 if self._external else self.threads

    @property
    def spare(self) -> int:
        """Shards that may wait at the workers of this machine, one a thread: who is free starts one at once."""
        return 0 if self._external else self.threads

    @property
    def threads(self) -> int:
        """Threads of the workers that may get tasks; 1 if there is none."""
        return max(1, sum(self._threads[address] for address in self.accepted))

    def restriction(self, avoided: Collection[str]) -> dict[str, Any]:
        """Return the arguments of `Client.submit` that keep a task from refused and from `avoided` workers."""
        preferred = [address for address in self.accepted if address not in avoided]
        if not preferred or len(preferred) == len(self._threads):
            return {}
        # A preference: a task bound to these alone would wait for ever when they have left.
        return {"workers": preferred, "allow_other_workers": True}

    def recheck(self, address: str) -> None:
        """Check a worker again that did not accept a task, or look for another one."""
        if self._external and not self._checked.get(address):
            self._checked.pop(address, None)
            self.look(now=True)

    def _check(self, new: list[str]) -> None:
        found = self._client.run(software, workers=new, on_error="return")
        for address, there in found.items():
            if isinstance(there, OSError):
                continue  # it is gone, or the next look queries it again
            self._checked[address] = difference(there)
            if self._checked[address]:
                self._say(self._refusal(address))
        if self._threads and all(self._checked.get(address) for address in self._threads):
            raise WorkFailed(f"every worker is refused; {self._refusal(next(iter(self._checked)))}")

    def _refusal(self, address: str) -> str:
        return f"worker {address} gets no task: {self._checked[address]}; install the same version there"
