"""Cluster: worker processes on this machine, or a dask scheduler that runs already.

The cluster on this machine speaks TLS on the loopback, with a certificate that is made for the run and kept in memory.
Only processes of the run hold it, so no other user of the machine can hand it work. Its ports answer nobody else.
"""

import asyncio
import logging
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final

from cyclopts import Parameter

from jobs.exits import handled
from pipeline.own_process import ONE_THREAD, interrupts_held
from weaves.errors import BadInput, WorkFailed
from weaves.reading import MIB, read_json

MOST_WORKERS: Final = 1024  # worker processes of a cluster on this machine, at most
_SECONDS: Final = 5  # for a scheduler to answer
_TRIES_TO_START: Final = 3  # the cluster on this machine
_SECONDS_FOR_A_WORKER: Final = 60  # a cluster that adapts starts one when there is work


@dataclass(frozen=True)
class Scheduler:
    """A running scheduler, and files for TLS, also on the command line; empty: a cluster on this machine."""

    address: Annotated[
        str,
        Parameter(
            name="--scheduler", help="Address or scheduler file of a running dask scheduler; default: this machine."
        ),
    ] = ""
    ca: Annotated[str, Parameter(name="--tls-ca", help="Certificate of the scheduler's authority, a PEM file.")] = ""
    certificate: Annotated[
        str, Parameter(name="--tls-certificate", help="Own certificate for the scheduler, a PEM file.")
    ] = ""
    key: Annotated[str, Parameter(name="--tls-key", help="Its key, a PEM file.")] = ""


HERE: Final = Scheduler()  # no scheduler: a cluster on this machine


@contextmanager
def connected(scheduler: Scheduler, workers: int, say: Callable[[str], None]) -> Iterator[Any]:
    """Connect to a scheduler, or start a cluster of so many workers that ends with this process.

    `say` receives a sentence when a scheduler has no worker yet, or the cluster is started again. BadInput if no
    scheduler answers, or it has no worker; WorkFailed if the processes of the cluster on this machine cannot start, or
    the scheduler is lost within the block.
    """
    # Before dask is imported, and inherited by workers: it reports every shutdown as a warning.
    os.environ.setdefault("DASK_LOGGING__DISTRIBUTED", "critical")
    from distributed import CancelledError
    from distributed.comm.core import CommClosedError

    try:
        with _external(scheduler, say) if scheduler.address else _local(workers, say) as client:
            yield client
    except (CancelledError, CommClosedError) as error:
        sentence = "the dask scheduler is gone; what was finished is kept, run the same command to go on"
        raise WorkFailed(sentence) from error


@contextmanager
def _external(scheduler: Scheduler, say: Callable[[str], None]) -> Iterator[Any]:
    from distributed import Client, Security

    for name in ("distributed", "distributed.client", "distributed.utils"):  # each has a level of its own
        logging.getLogger(name).setLevel(logging.CRITICAL)
    given = scheduler.address
    files = {"--tls-ca": scheduler.ca, "--tls-certificate": scheduler.certificate, "--tls-key": scheduler.key}
    for key, path in files.items():
        if path and not Path(path).is_file():
            raise BadInput(key, "", path, "is no file; a file in PEM format is needed")
    security = None
    if any(files.values()):
        security = Security(  # type: ignore[no-untyped-call]
            tls_ca_file=scheduler.ca or None,
            tls_client_cert=scheduler.certificate or None,
            tls_client_key=scheduler.key or None,
            require_encryption=True,
        )
    try:
        address = str(read_json(Path(given), MIB, "a scheduler file")["address"]) if Path(given).is_file() else given
        # A client alone would wait for minutes for a port that listens and never answers.
        asyncio.run(_answer(address, security))
        client = Client(address, timeout=_SECONDS, security=security)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError, KeyError, RuntimeError) as error:
        raise BadInput("--scheduler", "", given, "no dask scheduler answers at this address") from error
    with client:
        if not client.nthreads():  # type: ignore[no-untyped-call]
            say(f"{given}: no worker yet; waiting up to {_SECONDS_FOR_A_WORKER} s for one")
            needed = client.submit(os.getpid, pure=False)  # so that a cluster that adapts starts one
            try:
                client.wait_for_workers(1, timeout=_SECONDS_FOR_A_WORKER)
            except TimeoutError as error:
                raise BadInput("--scheduler", "", given, "this scheduler has no worker: start one") from error
            needed.result()
        yield client


async def _answer(address: str, security: Any) -> None:
    """Wait until a scheduler answers; TimeoutError if it does not."""
    from distributed.comm.core import connect

    arguments = security.get_connection_args("client") if security else {}
    comm = await asyncio.wait_for(connect(address, timeout=_SECONDS, **arguments), _SECONDS)  # type: ignore[no-untyped-call]
    comm.abort()


@contextmanager
def _ends_deferred() -> Iterator[None]:
    """Defer SIGTERM and SIGHUP to the end of the block, in this process alone: processes that start within are free."""
    received: list[int] = []
    try:
        with handled(lambda number, frame: received.append(number), signal.SIGTERM, signal.SIGHUP):
            yield
    finally:
        if received:
            signal.raise_signal(received[0])


@contextmanager
def _local(workers: int, say: Callable[[str], None]) -> Iterator[Any]:
    """Start a cluster on the loopback; again, if one of its processes dies before all are there."""
    from multiprocessing import resource_tracker

    import dask.config
    from distributed import Client, LocalCluster, Security

    resource_tracker.ensure_running()  # when it is started later, it lets Ctrl-C through again
    settings = {
        # In place of dask's own environment, whose MALLOC_TRIM_THRESHOLD_ makes every tensor a system call.
        "distributed.nanny.pre-spawn-environ": ONE_THREAD,
        # A worker that is replaced slowly, or dies again, is not given up: its supervisor always starts another.
        "distributed.deploy.lost-worker-timeout": "1000 days",
        # Its servers of web pages, which know no TLS, have no pages: other users would read names of tasks there.
        "distributed.scheduler.http.routes": [],
        "distributed.worker.http.routes": [],
    }
    with dask.config.set(settings):
        for left in reversed(range(_TRIES_TO_START)):
            try:
                with _ends_deferred(), interrupts_held():  # a cluster that is half there cannot be closed
                    cluster = LocalCluster(  # type: ignore[no-untyped-call]
                        n_workers=workers,
                        threads_per_worker=1,
                        processes=True,
                        host="127.0.0.1",
                        protocol="tls://",
                        security=Security.temporary(),  # type: ignore[no-untyped-call]
                        dashboard_address=None,
                        scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
                        memory_limit=0,  # tasks hand over files, not data: there is nothing that dask could spill
                        silence_logs=logging.CRITICAL + 1,  # a report to a client that leaves is critical to dask
                    )
                    client = Client(cluster)  # type: ignore[no-untyped-call]
                break
            except (OSError, RuntimeError) as error:
                reason = str(error).strip().splitlines()[:1] or [type(error).__name__]
                sentence = f"{workers} worker processes could not start: {reason[0]}"
                if not left:
                    raise WorkFailed(sentence) from error
                say(f"{sentence}; trying again")
        try:
            yield client
        finally:
            with _ends_deferred(), interrupts_held():
                try:
                    client.close()  # type: ignore[no-untyped-call]
                    cluster.close()
                except TimeoutError:
                    # On a busy machine a worker may not end in time while it compiles; its products are whole or not.
                    for worker in multiprocessing.active_children():
                        worker.kill()
