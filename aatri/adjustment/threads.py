"""Threads: how many, and work that is shared out among them."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache, partial
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from threadpoolctl import ThreadpoolController

from aatri.arrays import Int
from aatri.machine import processors

Scalar = TypeVar("Scalar", bound=np.generic)

WORTH_A_THREAD = 100_000
"""Items of light work for which a thread of their own pays."""


def default_threads() -> int:
    """Processors this process may use; NUMBA_NUM_THREADS where several processes share them."""
    if (share := os.environ.get("NUMBA_NUM_THREADS", "")).isdecimal():
        return max(1, int(share))
    return processors()


@lru_cache(maxsize=1)
def thread_control() -> ThreadpoolController:
    """The BLAS libraries that are loaded."""
    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """BLAS by one thread: small matrices are not worth a second one, and the last bits do not depend on its number."""
    with thread_control().limit(limits=1, user_api="blas"):
        yield


def run_all(pool: ThreadPoolExecutor, jobs: Sequence[Callable[[], None]]) -> None:
    """Run jobs, none of which waits for another."""
    for done in [pool.submit(job) for job in jobs]:
        done.result()


def in_threads(n: int, work: Callable[[int, int], None], *, worth: int = WORTH_A_THREAD) -> None:
    """Work on n items that do not depend on each other: `work(first, last)` for parts of them, in several threads.

    Parameters
    ----------
    worth : int
        Items for which a thread of their own pays.
    """
    parts = max(min(default_threads(), n // worth), 1)
    bounds = [n * k // parts for k in range(parts + 1)]
    if parts == 1:
        work(0, n)
        return
    with ThreadPoolExecutor(parts) as pool:
        run_all(pool, [partial(work, first, last) for first, last in pairwise(bounds)])


def items_between(start: Int, first: int, last: int) -> tuple[int, int]:
    """The items whose first row lies in first ... last - 1: the share of a thread, where rows belong to items.

    Parameters
    ----------
    start : (n_items + 1,) int
        First row of each item, ascending; the last is the number of rows.
    """
    a, b = np.searchsorted(start[:-1], [first, last])
    return int(a), int(b) if last < start[-1] else len(start) - 1


def taken(values: npt.NDArray[Scalar], order: Int) -> npt.NDArray[Scalar]:
    """Rows of an array in a given order, in several threads: such copies wait for memory, not for arithmetic."""
    ordered = np.empty((len(order), *values.shape[1:]), dtype=values.dtype)

    def part(first: int, last: int) -> None:
        np.take(values, order[first:last], axis=0, out=ordered[first:last], mode="clip")

    in_threads(len(order), part)
    return ordered


def by_rows(work: Callable[..., npt.NDArray[np.float64]], *columns: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """`work(*columns)`, each row of which follows from that row of the columns alone: in several threads.

    Pieces have the same size whatever the number of threads, so that the result has the same bits.
    """
    n = len(columns[0])
    pieces: list[npt.NDArray[np.float64]] = [np.empty(0)] * max(-(-n // WORTH_A_THREAD), 1)

    def some_pieces(first: int, last: int) -> None:
        for k in range(first, last):
            rows = slice(k * WORTH_A_THREAD, (k + 1) * WORTH_A_THREAD)
            pieces[k] = work(*(column[rows] for column in columns))

    in_threads(len(pieces), some_pieces, worth=1)
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
