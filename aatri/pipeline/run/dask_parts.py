"""Parts of one stage on the workers of a Dask cluster, going on together.

Each part is a task that lasts; what it works on is a file of the run folder. Messages go through the scheduler, to the
worker that makes the stage and back: into a queue, whose bell is rung then. Who waits, waits for the bell, and takes no
other task's place. A part whose worker has died is begun anew by another one, and is told again what it had been told.
"""

import importlib
import os
import pickle
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from aatri.errors import ResourceError
from aatri.pipeline.store import inside
from aatri.together import MEMORY_OF_WORKER, Answers, Combine, Exchange, Message, exchange_by

LONGEST_S = 2.0
"""Longest time between two looks for what rings no bell: a task that has failed, a stage that nobody makes any more."""


class Mailbox:
    """Messages for one reader, through the scheduler.

    Parameters
    ----------
    name : str
        Not in use elsewhere.
    """

    def __init__(self, client: Any, name: str) -> None:
        distributed = _modules()[1]
        self._messages, self._bell = distributed.Queue(name, client=client), distributed.Event(f"{name}-bell", client)

    def put(self, content: Any) -> int:
        """Send a message; its size in bytes."""
        packed = pickle.dumps(content, protocol=5)
        self._messages.put(packed)
        self._bell.set()
        return len(packed)

    def ring(self, *_: Any) -> None:
        """Let the reader look at something else."""
        self._bell.set()

    def packed(self) -> bytes:
        """The next message as it was sent; empty if there is none yet when the bell rings, or after `LONGEST_S`."""
        if not self._messages.qsize():
            self._bell.wait(LONGEST_S)
            self._bell.clear()  # what is rung for later is in the queue already
            if not self._messages.qsize():
                return b""
        return bytes(self._messages.get())


class DaskParts:
    """Parts as tasks of the cluster whose worker makes the stage.

    Parameters
    ----------
    base : Path
        The run, on disk.
    names : str
        Folder in it for what the parts work on.
    """

    def __init__(self, base: Path, *names: str) -> None:
        self._base, self._names = base, names
        self.sent_bytes = self.answered_bytes = 0

    def together(self, work: Callable[[Any, Exchange], Any], parts: Sequence[Any], combine: Combine) -> list[Any]:
        """The results of all parts, see `progress.Workers`.

        Raises
        ------
        ResourceError
            If workers die again and again.
        """
        cloudpickle, distributed = _modules()
        client = distributed.get_client()
        topic = f"aatri-{uuid.uuid4().hex}"
        up = Mailbox(client, f"{topic}-up")

        def answer(_: int, attempt: str, content: Any) -> None:
            self.answered_bytes += Mailbox(client, f"{topic}-{attempt}").put(content)

        answers = Answers(len(parts), combine, answer)
        files = [(*self._names, f"{topic}-{k}.pickle") for k in range(len(parts))]
        inside.make_folder(self._base, *self._names)
        for k, names in enumerate(files):  # one at a time is in memory, and once: it is large
            inside.write_by(partial(cloudpickle.dump, parts[k], protocol=5), self._base, *names)
        workers = sorted(client.scheduler_info(n_workers=-1)["workers"])
        tasks = [
            client.submit(
                _one,
                work,
                self._base,
                names,
                topic,
                k,
                key=f"{topic}-{k}",
                pure=False,
                **_preferred(workers, k),
            )
            for k, names in enumerate(files)
        ]
        for task in tasks:
            task.add_done_callback(up.ring)
        distributed.secede()
        fetching: dict[int, Future[Message]] = {}
        try:
            with ThreadPoolExecutor(len(parts)) as pool:
                while not answers.complete:
                    for k in _finished(tasks, fetching):
                        fetching[k] = pool.submit(tasks[k].result)
                        fetching[k].add_done_callback(up.ring)
                    for k in [k for k, one in fetching.items() if one.done() and k not in answers.results]:
                        answers.take(fetching[k].result())
                    self._take(up, answers)
            return answers.all_results()
        finally:
            client.cancel(tasks)
            for names in files:
                inside.remove(self._base, *names)
            distributed.rejoin()

    def _take(self, up: Mailbox, answers: Answers) -> None:
        """Take a message, if one comes before long."""
        if packed := up.packed():
            self.sent_bytes += len(packed)
            answers.take(pickle.loads(packed))


def _preferred(workers: Sequence[str], part: int) -> dict[str, Any]:
    """Where a part is wanted, of the workers in their order; anywhere while the scheduler has lost sight of all."""
    return {"workers": [workers[part % len(workers)]], "allow_other_workers": True} if workers else {}


def _finished(tasks: Sequence[Any], fetching: Mapping[int, Any]) -> list[int]:
    """Tasks whose results are there and not yet asked for: a result may be lost on its way, and is made again."""
    for k, task in enumerate(tasks):
        if task.status in ("error", "cancelled", "lost"):
            failure = task.exception() if task.status == "error" else task.status
            raise ResourceError(f"part {k + 1} cannot be made: {failure}", remedy="more workers, or more parts")
    return [k for k, task in enumerate(tasks) if task.status == "finished" and k not in fetching]


@contextmanager
def memory_of(worker: Any) -> Iterator[None]:
    """Let what computes within know the memory that a task of the worker may take: its share of the process."""
    before = os.environ.pop(MEMORY_OF_WORKER, None)
    if limit := worker.memory_manager.memory_limit:
        os.environ[MEMORY_OF_WORKER] = str(limit / max(worker.state.nthreads, 1))
    try:
        yield
    finally:
        os.environ.pop(MEMORY_OF_WORKER, None)
        if before is not None:
            os.environ[MEMORY_OF_WORKER] = before


def _modules() -> tuple[Any, Any]:
    """cloudpickle and distributed, without types."""
    return importlib.import_module("cloudpickle"), importlib.import_module("distributed")


def _one(work: Callable[[Any, Exchange], Any], base: Path, names: Sequence[str], topic: str, part: int) -> Message:
    """On a worker: a part, from its beginning."""
    from threadpoolctl import threadpool_limits

    distributed = _modules()[1]
    client = distributed.get_client()
    distributed.secede()
    attempt = uuid.uuid4().hex
    up, down = Mailbox(client, f"{topic}-up"), Mailbox(client, f"{topic}-{attempt}")
    result = list[Message]()

    def send(message: Message) -> None:
        if message.last:  # as the task's result: it may be large
            result.append(message)
        else:
            up.put(message)

    worker = distributed.get_worker()
    key = worker.get_current_task()

    def receive() -> Any:
        while True:
            if packed := down.packed():
                return pickle.loads(packed)
            task = worker.state.tasks.get(key)  # whoever made the stage may have died
            if task is None or task.state in ("cancelled", "released", "forgotten"):
                raise ResourceError("nobody waits for this part any more")

    exchange, end = exchange_by(part, attempt, send, receive)
    with threadpool_limits(limits=1, user_api="blas"), memory_of(worker):
        try:
            with inside.file_path(base, *names).open("rb") as file:
                taken = pickle.load(file)
            end(work(taken, exchange))
        except Exception as error:  # raised where the stage is made
            end(error)
    return result[0]
