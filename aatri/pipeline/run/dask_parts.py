"""Parts of one stage on the workers of a Dask cluster, going on together.

Each part is a task that lasts; what it works on is a file of the run folder. Messages go through the scheduler, to the
worker that makes the stage and back. Neither the stage nor a part takes the place of another task while it waits. A
part whose worker has died is begun anew by another one, and is told again what it had been told.
"""

from __future__ import annotations

import importlib
import pickle
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from aatri.errors import ResourceError
from aatri.pipeline.store import inside
from aatri.together import Answers, Combine, Exchange, Message, exchange_by

LONGEST_S = 0.25
"""Longest time between two looks for a message."""


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
        up = distributed.Queue(f"{topic}-up", client=client)

        def answer(_: int, attempt: str, content: Any) -> None:
            packed = pickle.dumps(content, protocol=5)
            self.answered_bytes += len(packed)
            distributed.Queue(f"{topic}-{attempt}", client=client).put(packed)

        answers = Answers(len(parts), combine, answer)
        files = [(*self._names, f"{topic}-{k}.pickle") for k in range(len(parts))]
        inside.make_folder(self._base, *self._names)
        for part, names in zip(parts, files):
            inside.write(cloudpickle.dumps(part, protocol=5), self._base, *names)
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
                workers=[workers[k % len(workers)]],
                allow_other_workers=True,
            )
            for k, names in enumerate(files)
        ]
        distributed.secede()
        fetching: dict[int, Future[Message]] = {}
        try:
            with ThreadPoolExecutor(len(parts)) as pool:
                while not answers.complete:
                    for k in _finished(tasks, fetching):
                        fetching[k] = pool.submit(tasks[k].result)
                        fetching[k].add_done_callback(lambda _: up.put(b""))
                    for k in [k for k, one in fetching.items() if one.done() and k not in answers.results]:
                        answers.take(fetching[k].result())
                    self._take(up, answers)
            return answers.all_results()
        finally:
            client.cancel(tasks)
            for names in files:
                inside.remove(self._base, *names)
            distributed.rejoin()

    def _take(self, up: Any, answers: Answers) -> None:
        """Take a message, if one comes before long."""
        packed = _got(up)
        if packed:
            self.sent_bytes += len(packed)
            answers.take(pickle.loads(packed))


def _finished(tasks: Sequence[Any], fetching: Mapping[int, Any]) -> list[int]:
    """Tasks whose results are there and not yet asked for: a result may be lost on its way, and is made again."""
    for k, task in enumerate(tasks):
        if task.status in ("error", "cancelled", "lost"):
            why = task.exception() if task.status == "error" else task.status
            raise ResourceError(f"part {k + 1} cannot be made: {why}", remedy="more workers, or more parts")
    return [k for k, task in enumerate(tasks) if task.status == "finished" and k not in fetching]


def _modules() -> tuple[Any, Any]:
    """cloudpickle and distributed, without types."""
    return importlib.import_module("cloudpickle"), importlib.import_module("distributed")


def _got(messages: Any) -> bytes:
    """The next message of a queue; empty if none comes while the looks for it become rarer."""
    pause_s = 0.001
    while not messages.qsize():
        if pause_s > LONGEST_S:
            return b""
        time.sleep(pause_s)
        pause_s *= 2
    return bytes(messages.get())


def _one(work: Callable[[Any, Exchange], Any], base: Path, names: Sequence[str], topic: str, part: int) -> Message:
    """On a worker: a part, from its beginning."""
    from threadpoolctl import threadpool_limits

    distributed = _modules()[1]
    client = distributed.get_client()
    distributed.secede()
    attempt = uuid.uuid4().hex
    up = distributed.Queue(f"{topic}-up", client=client)
    down = distributed.Queue(f"{topic}-{attempt}", client=client)
    result = list[Message]()

    def send(message: Message) -> None:
        if message.last:  # as the task's result: it may be large
            result.append(message)
        up.put(b"" if message.last else pickle.dumps(message, protocol=5))  # nothing wakes who waits

    worker = distributed.get_worker()
    key = worker.get_current_task()

    def receive() -> Any:
        while True:
            if packed := _got(down):
                return pickle.loads(packed)
            task = worker.state.tasks.get(key)  # whoever made the stage may have died
            if task is None or task.state in ("cancelled", "released", "forgotten"):
                raise ResourceError("nobody waits for this part any more")

    exchange, end = exchange_by(part, attempt, send, receive)
    with threadpool_limits(limits=1, user_api="blas"):
        try:
            end(work(pickle.loads(inside.file_path(base, *names).read_bytes()), exchange))
        except Exception as error:  # raised where the stage is made
            end(error)
    return result[0]
