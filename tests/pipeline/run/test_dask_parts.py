"""One adjustment in parts on a Dask cluster: the bits of one process, also where workers die in the middle of it."""

from __future__ import annotations

import os
import pickle
import threading
from pathlib import Path
from queue import SimpleQueue
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aatri.adjustment.iterative.forecast import memory_limit
from aatri.adjustment.parts import adjust as in_parts
from aatri.adjustment.problem import SolverSettings
from aatri.pipeline.run import dask_parts
from aatri.pipeline.run.dask_parts import DaskParts
from aatri.together import Threads
from tests.adjustment.block_problem import joined_problem

distributed: Any = pytest.importorskip("distributed", reason="Dask is not installed")

RESULT = 10_000
"""Stands for the moment at which a part has its result."""


class Mortal:
    """A part's work whose process ends before a message, the first time it comes to it."""

    def __init__(self, work: Any, before: int, marker: Path, last: Any) -> None:
        self.work, self.before, self.marker, self.last = work, before, marker, last

    def __call__(self, part: Any, exchange: Any) -> Any:
        sent, last = 0, part.part.own["a"][-1] == self.last

        def die(now: int) -> None:
            if last and now == self.before and not self.marker.exists():
                self.marker.touch()
                os._exit(1)

        def mortal(message: Any) -> Any:
            nonlocal sent
            die(sent)
            sent += 1
            return exchange(message)

        result = self.work(part, mortal)
        die(RESULT)
        return result


def test_what_computes_on_a_worker_knows_its_share_of_memory_and_what_comes_after_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv("AATRI_MEMORY_OF_WORKER", raising=False)
    of_machine = memory_limit(None)
    memory = SimpleNamespace(memory_limit=1_000_000_000)
    with dask_parts.memory_of(SimpleNamespace(memory_manager=memory, state=SimpleNamespace(nthreads=2))):
        assert memory_limit(None) == 400_000_000
    assert memory_limit(None) == of_machine


class MortalParts:
    """Parts one of which dies."""

    def __init__(self, folder: Path, before: int) -> None:
        self.parts, self.before, self.marker = DaskParts(folder, "checkpoints"), before, folder / f"died-{before}"

    def together(self, work: Any, parts: Any, combine: Any) -> list[Any]:
        last = parts[1].part.own["a"][-1]  # the second part is not at the worker that makes the stage
        return self.parts.together(Mortal(work, self.before, self.marker, last), parts, combine)


def _adjusted(workers: Any) -> Any:
    unknowns, records, start = joined_problem(2, n_kept=140, n_points=700, rays=4)
    settings = SolverSettings(ordering="nested_dissection", reproducible=True, parts=2, workers=workers, threads=1)
    found = in_parts.adjust(unknowns, records, start, settings=settings, vetoes=[None] * len(records), covariances=True)
    assert isinstance(found, in_parts.AdjustedInParts)
    return found.state, found.covariances.groups


def _on_cluster(folder: Path, before: int) -> Any:
    return _adjusted(MortalParts(folder, before))


@pytest.mark.slow
def test_who_waits_for_a_message_looks_for_it_when_the_bell_rings_and_not_before(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks, queue = [], SimpleQueue[bytes]()
    messages = SimpleNamespace(put=queue.put, get=queue.get, qsize=lambda: looks.append(0) or queue.qsize())
    scheduler = SimpleNamespace(Queue=lambda name, client: messages, Event=lambda name, client: threading.Event())
    monkeypatch.setattr(dask_parts, "_modules", lambda: (None, scheduler))
    box = dask_parts.Mailbox(None, "box")
    threading.Timer(0.5, box.put, ["a message"]).start()
    assert pickle.loads(box.packed()) == "a message"
    assert len(looks) == 2
    threading.Timer(0.1, box.ring).start()
    assert box.packed() == b""


def test_parts_are_dealt_out_to_the_workers_in_sight_and_wait_for_any_while_there_is_none() -> None:
    client = distributed.Client(processes=False, n_workers=0, dashboard_address=None, set_as_default=False)
    with client, client.cluster:
        assert dask_parts._preferred(["a", "b"], 3) == {"workers": ["b"], "allow_other_workers": True}
        task = client.submit(sum, (1, 2), **dask_parts._preferred([], 3))
        client.cluster.scale(1)
        assert task.result(timeout=60) == 3


@pytest.mark.slow
def test_a_worker_that_dies_in_an_iteration_changes_no_bit(tmp_path: Path) -> None:
    """Before its first message, in the middle of an iteration, and with the result made; all: `worker_deaths`."""
    state, groups = _adjusted(Threads())
    deaths = (0, 2, RESULT)
    with (  # a worker that dies is started again; meanwhile two are left
        distributed.LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster,
        distributed.Client(cluster) as client,
    ):
        for before in deaths:
            client.wait_for_workers(2, timeout=120)
            first = min(client.scheduler_info(n_workers=-1)["workers"])
            found = client.submit(_on_cluster, tmp_path, before, workers=[first], pure=False).result(timeout=60)
            assert (tmp_path / f"died-{before}").exists()
            for name, values in state.items():
                np.testing.assert_array_equal(found[0][name], values)
                np.testing.assert_array_equal(found[1][name], groups[name])
            assert not list((tmp_path / "checkpoints").iterdir())
