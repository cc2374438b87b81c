"""Stages as tasks of a Dask cluster: the workers of a scheduler that runs already, or processes of this machine.

A worker gets names and paths, as a spawned process does; it reads inputs from the run folder, which all machines share,
and adds its result to it. A worker that dies has made nothing current: Dask gives its task to another one. What is
computed does not depend on the place: one thread of BLAS, kernels whose sums have a fixed order, the same code and the
same versions, which are compared before the first task.
"""

import contextlib
import hashlib
import re
import uuid
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from aatri.errors import ResourceError, SpecError
from aatri.machine import processors
from aatri.pipeline.methods.code_digest import BUILT_IN
from aatri.pipeline.run.context import Tell
from aatri.pipeline.run.dask_parts import DaskParts, memory_of
from aatri.pipeline.run.task import Task, TaskOutcome, failed
from aatri.pipeline.store import inside
from aatri.pipeline.store.provenance import environment

LOCAL = "local:"
_MEMORY = re.compile(r"([0-9]+(?:\.[0-9]+)?)([GM])B")
COMPARED = ("aatri", "python", "numpy", "scipy", "numba", "h5py", "code")
"""What a worker must have as this process has it, for a stage's key names the code here."""


@contextlib.contextmanager
def dask_pool(cluster: Any, run: Path, tell: Tell) -> Iterator["_Workers"]:
    """The workers of a cluster.

    Parameters
    ----------
    cluster : str or distributed.Client
        Address of a scheduler, `tcp://HOST:PORT`; `local:WORKERS` processes of this machine, with a limit of memory for
        each `local:WORKERS:MEMORY`; a client stays open.
    run : Path
        The run folder.
    tell : callable
        Takes stage, event and what belongs to it.

    Raises
    ------
    SpecError
        If the address is none.
    ResourceError
        If Dask is not installed, the scheduler does not answer, or a worker does not see the run folder or has other
        versions.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ResourceError("Dask is not installed", remedy='pip install "aatri[dask]"') from error
    with contextlib.ExitStack() as stack:
        client = cluster if isinstance(cluster, Client) else _connected(cluster, stack)
        _check(client, run)
        workers = _Workers(client, tell)
        try:
            yield workers
        finally:
            workers.close()


def _connected(address: str, stack: contextlib.ExitStack) -> Any:
    """A client of an address, closed with the stack."""
    import distributed

    connect: Any = distributed.Client  # without types
    target: Any = address
    if address.startswith(LOCAL):
        try:
            target = stack.enter_context(_local_cluster(address))
        except RuntimeError as error:  # what Dask raises where a process does not start
            raise ResourceError(
                f"local workers do not start: {error}", remedy="fewer workers; see what else runs"
            ) from error
    elif "://" not in address:
        raise SpecError(f"--cluster {address} is no address", remedy="tcp://HOST:PORT of a scheduler, or local:4")
    try:
        return stack.enter_context(connect(target, timeout=30, set_as_default=False))
    except OSError as error:
        raise ResourceError(f"no scheduler answers at {address}: {error}", remedy="dask scheduler") from error


def _local_cluster(address: str) -> Any:
    """Processes of this machine, each with its share of the cores."""
    from distributed import LocalCluster

    count, colon, memory = address.removeprefix(LOCAL).partition(":")
    size = _MEMORY.fullmatch(memory)
    memory_bytes = int(float(size[1]) * {"G": 1e9, "M": 1e6}[size[2]]) if size else 0
    if colon and not memory_bytes:  # Dask takes 0 for no limit
        raise SpecError(f"--cluster {address}: {memory or 'nothing'} is no size of memory", remedy="local:2:6GB")
    if not count.isdecimal() or not int(count):
        raise SpecError(f"--cluster {address}: {count or 'nothing'} is no number of workers", remedy="local:4")
    threads = str(max(1, processors() // int(count)))
    cluster: Any = LocalCluster  # without types
    return cluster(
        n_workers=int(count),
        threads_per_worker=1,
        memory_limit=memory_bytes if colon else "auto",
        dashboard_address="127.0.0.1:0",
        env={"OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": threads},
    )


def _check(client: Any, run: Path) -> None:
    """See that there are workers, that each sees the run folder and computes with what this process computes with."""
    token = uuid.uuid4().hex
    path = inside.write(token.encode(), run, f".shared-{token}")
    try:
        answers = client.run(_about, str(path.resolve()))
    finally:
        path.unlink(missing_ok=True)
    if not answers:
        raise ResourceError("the cluster has no worker", remedy="dask worker ADDRESS")
    own = _versions()
    for worker, (seen, versions) in answers.items():
        if seen != token:
            raise ResourceError(
                f"worker {worker} does not see {run.resolve()}",
                remedy="put the run into a folder that all machines share",
            )
        others = [
            f"{name} {versions.get(name)} instead of {own[name]}"
            for name in COMPARED
            if versions.get(name) != own[name]
        ]
        if others:
            raise ResourceError(
                f"worker {worker} has {', '.join(others)}", remedy="the same environment on all machines"
            )


def _about(path: str) -> tuple[str, dict[str, str]]:
    """On a worker: what it reads there, and its versions."""
    try:
        seen = Path(path).read_text(encoding="utf-8")
    except OSError:
        seen = ""
    return seen, _versions()


def _versions() -> dict[str, str]:
    """Versions, and a digest of the code of aatri and of its stages, which lie beside it in a checkout."""
    digest = hashlib.sha256()
    for package, folder in sorted(BUILT_IN.items()):
        for path in sorted(folder.rglob("*.py")):
            digest.update(f"{package}/{path.relative_to(folder).as_posix()}".encode() + b"\0" + path.read_bytes())
    return {**environment(), "numba": version("numba"), "code": digest.hexdigest()[:12]}


class _Workers:
    """The workers of a client; as many stages at once as there are workers."""

    def __init__(self, client: Any, tell: Tell) -> None:
        self._client, self._tell = client, tell
        self._topic = f"aatri-{uuid.uuid4().hex}"
        self._client.subscribe_topic(self._topic, self._hear)
        self._under_way: set[Any] = set()

    @property
    def jobs(self) -> int:
        """How many stages run at once."""
        return max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))

    def submit(self, task: Task) -> Future[TaskOutcome]:
        """Begin a task."""
        outcome: Future[TaskOutcome] = Future()
        far = replace(task, run=task.run.resolve(), base=task.base.resolve())
        begun = self._client.submit(_perform, far, self._topic, key=f"{task.stage}-{uuid.uuid4().hex}", pure=False)
        self._under_way.add(begun)

        def pass_on(done: Any) -> None:
            self._under_way.discard(begun)
            try:
                made, events = done.result()
            except Exception as error:  # a worker that died, with all that came after it, or what cannot be sent
                died = ResourceError(f"{task.stage}: {type(error).__name__}: {error}", remedy="more memory per worker")
                outcome.set_result(failed(died))
                return
            for event in events:
                self._tell(task.stage, *event)
            outcome.set_result(made)

        begun.add_done_callback(pass_on)
        return outcome

    def close(self) -> None:
        """Give up what is under way: without a record it does not exist."""
        self._client.unsubscribe_topic(self._topic)
        self._client.cancel(list(self._under_way))

    def _hear(self, event: tuple[float, tuple[Any, ...]]) -> None:
        self._tell(*event[1])


def _perform(task: Task, topic: str) -> tuple[TaskOutcome, list[tuple[Any, ...]]]:
    """On a worker: make a stage. How far it is, is told at once, warnings with the result."""
    from distributed import get_worker
    from threadpoolctl import threadpool_limits

    from aatri.pipeline.run.worker import perform

    events = list[tuple[Any, ...]]()
    worker = get_worker()

    def tell(*event: Any) -> None:
        if event[0] == "advanced":
            worker.log_event(topic, (task.stage, *event))
        else:
            events.append(event)

    with threadpool_limits(limits=1, user_api="blas"), memory_of(worker):
        return perform(task, tell, cluster=DaskParts), events
