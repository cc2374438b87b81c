"""Results of the single items of a stage: of an image, of a pair of images; each made once.

    RUN/items/STAGE/KEY.h5      KEY: SHA-256 of the function, the code that it reaches, and its arguments

What is missing is made in as many processes as a stage may have cores, one item at a time in each, and kept as soon as
it is there: a run that was killed goes on from there, and an image more makes itself and its pairs. Results are in the
order of the items, and the same for any number of processes.
"""

import hashlib
import importlib
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aatri.errors import AatriError, ArtifactError, ResourceError
from aatri.pipeline.methods.code_digest import CodeReader
from aatri.pipeline.run.task import TaskOutcome, failed
from aatri.pipeline.run.workers import begin_worker, processes_of_a_stage
from aatri.pipeline.store import inside
from aatri.pipeline.store.cache import Cache
from aatri.pipeline.store.inside import on_disk
from aatri.pipeline.store.objects import ITEMS
from aatri.progress import Item, Reporter, loaded
from aatri.tables import hdf5

KEY_DIGITS = 32
AHEAD = 2
"""Items handed out for each process: one under way, one that waits."""
GUARD = 'in a script of your own, call aatri below `if __name__ == "__main__":`, for every process imports the script'
"""Remedy where processes end before they begin: Python spawns them by importing the script that runs."""


@dataclass(frozen=True)
class KeptItem:
    """The result of an item, in its file."""

    base: Path
    stage: str
    digest: str
    kind: type[Any]

    @property
    def names(self) -> tuple[str, str, str]:
        """Where it lies below the run."""
        return ITEMS, self.stage, f"{self.digest}.h5"

    def load(self) -> Any:
        """The artifact."""
        return hdf5.read(inside.file_path(self.base, *self.names), self.kind)

    def is_whole(self) -> bool:
        """Whether it is there; what is damaged is as good as not there."""
        try:
            self.load()
        except (FileNotFoundError, ArtifactError):
            return False
        return True


class ItemStore:
    """The items of one stage of a run."""

    def __init__(self, base: Path, stage: str) -> None:
        self._base, self._stage = base, stage

    def results(
        self, function: Callable[..., Any], items: Sequence[Item], kind: type[Any], what: str, reporter: Reporter
    ) -> list[KeptItem]:
        """The results of all items, in their order; see `progress.StageContext.mapped`.

        Raises
        ------
        AatriError
            That of the first item that fails; what was made by then is kept.
        """
        code = _code_of(function)
        kept = [KeptItem(self._base, self._stage, _key(code, item), kind) for item in items]
        missing = []
        for k, one in enumerate(kept):
            if one.is_whole():
                with on_disk(self._base):
                    inside.file_path(self._base, *one.names).touch()  # in use, see `store.gc`
            else:
                missing.append(k)
        if missing:
            reporter.log(f"{what}: {len(items) - len(missing)} of {len(items)} are there already")
            with on_disk(self._base):
                inside.make_folder(self._base, ITEMS, self._stage)
            self._make({k: (function, items[k], kept[k]) for k in missing}, len(items), what, reporter)
        return kept

    def _make(
        self, work: Mapping[int, tuple[Callable[..., Any], Item, KeptItem]], total: int, what: str, reporter: Reporter
    ) -> None:
        done, begun = total - len(work), time.monotonic()

        def advance(outcome: TaskOutcome) -> None:
            nonlocal done
            outcome.raise_error()
            done += 1
            made = done - (total - len(work))
            left_s = (time.monotonic() - begun) / made * (total - done)
            reporter.progress(done, total, f"{what}, {_duration(left_s)} left")

        processes = min(processes_of_a_stage(), len(work))
        if processes == 1:
            for one in work.values():
                advance(_made(*one))
            return
        import multiprocessing

        method = multiprocessing.get_context("spawn")
        executor = ProcessPoolExecutor(processes, method, begin_worker, (None, os.getpid()))
        waiting, under_way = iter(work.values()), set[Future[TaskOutcome]]()
        try:
            while True:
                free = AHEAD * processes - len(under_way)
                under_way |= {executor.submit(_made, *one) for _, one in zip(range(free), waiting)}
                if not under_way:
                    return
                finished, under_way = wait(under_way, return_when=FIRST_COMPLETED)
                for future in finished:
                    advance(future.result())
        except BrokenProcessPool as error:
            died = f"a process of {self._stage} was ended from outside, perhaps for lack of memory"
            remedy = f"aatri run again goes on; else a machine with more memory; {GUARD}"
            raise ResourceError(died, remedy=remedy) from error
        finally:
            executor.shutdown(wait=True, cancel_futures=True)


def _made(function: Callable[..., Any], item: Item, kept: KeptItem) -> TaskOutcome:
    """Make an item and keep it; an error is told with its name."""
    try:
        artifact = function(*item.files, *map(loaded, item.arguments))
        with on_disk(kept.base):
            final = inside.path_of(kept.base, *kept.names)
            temporary = inside.temporary_name(final)
            try:
                hdf5.write(artifact, temporary)
                inside.sync(temporary)
                temporary.replace(final)
                inside.sync(final.parent)
            finally:
                temporary.unlink(missing_ok=True)
    except AatriError as error:
        error.where = error.where or item.name
        return failed(error)
    return TaskOutcome()


def _code_of(function: Callable[..., Any]) -> str:
    """Name of a function and digest of the code that it reaches."""
    path = importlib.import_module(function.__module__).__file__
    code = CodeReader(Cache(None)).code_of(function.__module__, Path(str(path)))
    return f"{function.__module__}.{function.__qualname__} {code.digest}"


def _key(code: str, item: Item) -> str:
    plain = [{"kept": a.digest} if hasattr(a, "load") else a for a in item.arguments]
    text = json.dumps([code, plain], sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_DIGITS]


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"
