"""A worker that dies before any message of an adjustment in parts, on a Dask cluster of this machine: the same bits.

    python -m tests.campaigns.worker_deaths

The adjustment of `tests/pipeline/run/test_dask_parts.py`, once for each message that its second part sends: each phase
of each iteration, the covariances at the end, and its result. Each line says before which message the worker died and
whether values and covariances are those of threads, bit by bit.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from aatri.together import Threads
from tests.pipeline.run.test_dask_parts import RESULT, _adjusted, _on_cluster, distributed


class Listening(Threads):
    """Parts in threads; keeps the kinds of the messages of the second one."""

    def __init__(self) -> None:
        self.kinds: list[str] = []

    def together(self, work: Any, parts: Any, combine: Any) -> list[Any]:
        def heard(messages: list[Any]) -> list[Any]:
            self.kinds.append(type(messages[-1]).__name__)
            return combine(messages)

        return super().together(work, parts, heard)


def told() -> Iterator[str]:
    """A line for each death."""
    listening = Listening()
    state, groups = _adjusted(listening)
    for before, kind in [*enumerate(listening.kinds), (RESULT, "its result")]:
        made, died = _with_a_death(before)
        equal = all(
            np.array_equal(made[k][name], values, equal_nan=True)
            for k, of in enumerate((state, groups))
            for name, values in of.items()
        )
        yield f"before {kind} ({before}): {'same bits' if died and equal else 'WRONG'}"


def _with_a_death(before: int) -> tuple[Any, bool]:
    """Values and covariances from a cluster of its own, which has a worker to spare, and whether one has died in it."""
    with (
        distributed.LocalCluster(n_workers=3, threads_per_worker=1, dashboard_address="127.0.0.1:0") as cluster,
        distributed.Client(cluster) as client,
        tempfile.TemporaryDirectory() as folder,
    ):
        first = min(client.scheduler_info(n_workers=-1)["workers"])
        made = client.submit(_on_cluster, Path(folder), before, workers=[first], pure=False).result(timeout=600)
        return made, (Path(folder) / f"died-{before}").exists()


if __name__ == "__main__":
    for line in told():
        print(line, flush=True)  # noqa: T201
