"""Where tasks are carried out: in this process one after the other, or in spawned processes side by side.

Spawned processes get tasks, which are names and paths, and import the stages themselves. Every process computes with
one thread of BLAS unless the environment says otherwise: more would change the last bits of a Cholesky factor, and
results must not depend on how many stages run at once. Compiled kernels, whose sums have a
fixed order, share the cores.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from aatri.errors import ResourceError
from aatri.machine import memory_bytes, processors
from aatri.pipeline.run.task import Task, TaskOutcome, failed

if TYPE_CHECKING:
    from aatri.pipeline.run.context import Tell
    from aatri.tables.schema import Artifact

_BLAS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
_KERNELS = "NUMBA_NUM_THREADS"

LEAST_BYTES = 700_000_000
"""Address space below which OpenBLAS, LLVM or a thread cannot start: they end the process, or try for ever. The block
of the tutorial (15 images) takes up to 674 MB (VmPeak, 2026, 64 bits); at 629 MB its stage `start` never ended."""

MOST_KEPT_BYTES = 500_000_000
"""Artifacts that stay in memory though the next stage does not need them: to read them back takes a second a GB."""

_queue: Any = None
"""In a worker process: leads to the process that started it."""


class WorkerPool(Protocol):
    """Carries out tasks."""

    @property
    def jobs(self) -> int:
        """How many tasks at once."""

    def submit(self, task: Task) -> Future[TaskOutcome]:
        """Begin a task."""


def share_cores(jobs: int) -> None:
    """Set the threads of a process, before numpy is imported in it.

    Raises
    ------
    ResourceError
        If the process may have so little memory that numeric libraries end or stop it while they are loaded.
    """
    if _memory_limit() < LEAST_BYTES:
        raise ResourceError(
            f"this process may take {_memory_limit() / 1e6:.0f} MB of memory, and libraries alone need "
            f"{LEAST_BYTES / 1e6:.0f} MB",
            remedy="raise the limit (ulimit -v)",
        )
    for name in _BLAS:
        os.environ.setdefault(name, "1")
    os.environ.setdefault(_KERNELS, str(max(1, processors() // jobs)))


def processes_of_a_stage() -> int:
    """How many processes one stage may have: its share of the cores."""
    return int(os.environ.get(_KERNELS) or processors())


def _take_buffers() -> None:
    """Let OpenBLAS take its buffer while there is memory: later, without any, it would try for ever."""
    if _memory_limit() < float("inf"):
        import numpy as np

        np.linalg.solve(np.eye(64) * 2.0, np.eye(64) @ np.eye(64))


def _memory_limit() -> float:
    """Bytes of address space that this process may have."""
    try:
        import resource
    except ImportError:  # pragma: no cover - Windows has no such limit
        return float("inf")
    soft = resource.getrlimit(resource.RLIMIT_AS)[0]
    return float("inf") if soft == resource.RLIM_INFINITY else float(soft)


@contextlib.contextmanager
def pool(
    jobs: int, tell: Tell, *, cluster: Any = "", run: Path = Path(), in_memory: dict[str, Artifact] | None = None
) -> Iterator[WorkerPool]:
    """A pool for so many stages at once, or the workers of a cluster; `tell` takes stage, event and its values.

    Artifacts made in this process are left `in_memory` by content digest, as far as `MOST_KEPT_BYTES` permits.
    """
    share_cores(jobs)
    _take_buffers()
    if cluster:
        from aatri.pipeline.run.dask_pool import dask_pool

        with dask_pool(cluster, run, tell) as workers:
            yield workers
        return
    if jobs == 1:
        kept: dict[str, Artifact] = {} if in_memory is None else in_memory
        yield _Here(tell, kept)
        if _bytes_of(kept) > MOST_KEPT_BYTES:
            kept.clear()
        return
    with _Processes(jobs, tell) as processes:
        yield processes


def _bytes_of(artifacts: Mapping[str, Artifact]) -> int:
    from aatri.tables.schema import size_of

    return sum(map(size_of, artifacts.values()))


class _Here:
    """In this process; artifacts stay in memory for stages and the report, large ones only for the next stage."""

    jobs = 1

    def __init__(self, tell: Tell, in_memory: dict[str, Artifact]) -> None:
        self._tell, self._memory = tell, in_memory

    def submit(self, task: Task) -> Future[TaskOutcome]:
        from aatri.pipeline.run.worker import perform

        if _bytes_of(self._memory) > MOST_KEPT_BYTES:
            needed = {str(record["output"]["content_digest"]) for record in task.inputs.values()}
            for digest in self._memory.keys() - needed:
                del self._memory[digest]
        _prepare_memory(task)
        future: Future[TaskOutcome] = Future()
        future.set_result(perform(task, lambda *event: self._tell(task.stage, *event), self._memory))
        return future


_TRIM_THRESHOLD, _MMAP_THRESHOLD, _ARENA_MAX = -1, -3, -8
"""Parameters of mallopt(3)."""
_AMPLE = 16
"""Memory over the size of a stage's inputs, with which it is ample: stages take some five times that size (4,000 and
16,000 images), and three times as much leaves room for what arrays that come and go leave unused between them."""
_KEPT_BYTES, _TRIMMED_BYTES = (64 << 20, 32 << 20), 256 << 20
"""Arrays up to this size are kept with ample memory, as far as the C library allows, and so much at the end of all:
fresh pages were a fifth of the processor time of 4,000 images; with 64 MB a quarter of that is left, with 32 half."""


def _prepare_memory(task: Task, jobs: int = 1) -> None:
    """Keep arrays that are freed where memory is ample; else let the system have all that is free."""
    size = sum(int(record["output"]["size"]) for record in task.inputs.values())
    with contextlib.suppress(OSError, AttributeError, ValueError):  # glibc alone has it
        library, is_ample = ctypes.CDLL(None), _AMPLE * jobs * size < min(memory_bytes(), _memory_limit())
        library.mallopt(_ARENA_MAX, 1)  # arenas of threads return what they have on their own terms
        for most in _KEPT_BYTES if is_ample else (4 << 20,):
            if library.mallopt(_MMAP_THRESHOLD, most):
                break  # older versions refuse more than 32 MB
        library.mallopt(_TRIM_THRESHOLD, _TRIMMED_BYTES if is_ample else 128 << 10)
        if not is_ample:
            library.malloc_trim(0)


class _Processes:
    """Spawned processes, ended when the run is left before its end."""

    def __init__(self, jobs: int, tell: Tell) -> None:
        import multiprocessing

        method, self.jobs = multiprocessing.get_context("spawn"), jobs
        self._events = method.SimpleQueue()
        self._executor = ProcessPoolExecutor(jobs, method, begin_worker, (self._events, os.getpid()))
        self._listening = threading.Thread(target=self._listen, args=(tell,), daemon=True)

    def __enter__(self) -> _Processes:
        self._listening.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            for process in list((self._executor._processes or {}).values()):
                process.kill()  # what it was at stays without a record, and so does not exist
        self._executor.shutdown(wait=True, cancel_futures=True)
        self._events.put(None)
        self._listening.join()
        self._events.close()

    def submit(self, task: Task) -> Future[TaskOutcome]:
        outcome: Future[TaskOutcome] = Future()

        def pass_on(done: Future[TaskOutcome]) -> None:
            try:
                outcome.set_result(done.result())
            except BrokenProcessPool:
                died = ResourceError(
                    f"the process of {task.stage} was ended from outside, perhaps for lack of memory",
                    remedy="fewer --jobs, or a machine with more memory",
                )
                outcome.set_result(failed(died))
            except BaseException as error:
                outcome.set_exception(error)

        try:
            self._executor.submit(_perform, task, self.jobs).add_done_callback(pass_on)
        except BrokenProcessPool:
            outcome.set_result(failed(ResourceError("a worker process was ended from outside: no more can be started")))
        return outcome

    def _listen(self, tell: Tell) -> None:
        while (event := self._events.get()) is not None:
            tell(*event)


def begin_worker(queue: Any, parent: int) -> None:
    """A worker process starts: interrupts are its parent's business, and it does not outlive the parent."""
    global _queue
    _queue = queue
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        import ctypes

        with contextlib.suppress(OSError, AttributeError):
            ctypes.CDLL(None).prctl(1, int(signal.SIGKILL))  # PR_SET_PDEATHSIG
            if os.getppid() != parent:
                os._exit(1)


def _perform(task: Task, jobs: int) -> TaskOutcome:
    from aatri.pipeline.run.worker import perform

    _prepare_memory(task, jobs)
    return perform(task, lambda *event: _queue.put((task.stage, *event)))
