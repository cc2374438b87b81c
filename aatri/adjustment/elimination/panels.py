"""Panels of the factor, in memory or in a file.

A front leaves the panel L11, L21 of its own unknowns. Nothing needs it again until the way back down the tree, so that
under a memory limit it may wait in a temporary file, at a place the tree has set. Right-hand sides go up and down the
tree panel by panel. The file has no name where the
operating system allows that, and is gone with the factor, after an error too. What is read is what was written, bit
for bit.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import zip_longest
from threading import Lock
from typing import Protocol

import numpy as np

from aatri.adjustment.elimination import lapack
from aatri.adjustment.structure.tree import Tree
from aatri.arrays import Float
from aatri.errors import ResourceError

_NO_PANEL = np.zeros((0, 0))


def up_the_tree(tree: Tree, panels: Panels, x: Float, nodes: Iterable[int] | None = None) -> None:
    """Forward substitution of right-hand sides (n_kept, m), in place: x <- L^-1 x, at some nodes or all.

    Parameters
    ----------
    nodes : iterable of int, optional
        Children before their parents.
    """
    order, met = range(len(tree.nodes)) if nodes is None else nodes, _met_by(tree, x)
    for k, panel in panels.in_order([k for k in order if tree.nodes[k].panel and met[k]]):
        columns = tree.nodes[k].columns
        nonzero = np.flatnonzero(x[columns[: panel.shape[1]]].any(axis=0))
        if len(nonzero):
            front = np.asfortranarray(x[np.ix_(columns, nonzero)])
            lapack.forward_columns(panel, front)
            x[np.ix_(columns, nonzero)] = front


def _met_by(tree: Tree, x: Float) -> list[bool]:
    """Which nodes right-hand sides meet on their way up: by unknowns of their own or of a node below."""
    met: list[bool] = []
    for node in tree.nodes:
        met.append(bool(x[node.columns[: node.panel]].any()) or any(met[child] for child in node.children))
    return met


def down_the_tree(tree: Tree, panels: Panels, x: Float, nodes: Iterable[int] | None = None) -> None:
    """Back substitution, in place: x <- L^-T x, at some nodes, parents before their children, or all."""
    order = reversed(range(len(tree.nodes))) if nodes is None else nodes
    for k, panel in panels.in_order([k for k in order if tree.nodes[k].panel and x.shape[1]]):
        columns = tree.nodes[k].columns
        front = np.asfortranarray(x[columns])
        lapack.backward_columns(panel, front)
        x[columns[: panel.shape[1]]] = front[: panel.shape[1]]


class Panels(Protocol):
    """One panel for each node, (n, m) float64, column-major; one that is put here is no part of its front."""

    def __getitem__(self, k: int) -> Float: ...
    def __setitem__(self, k: int, panel: Float) -> None: ...

    def in_order(self, nodes: Sequence[int]) -> Iterator[tuple[int, Float]]:
        """Nodes with their panels, in this order."""

    def release(self, k: int) -> None:
        """Give back the memory of a panel, which cannot be asked for any more."""

    def clear(self) -> None:
        """Give back the room; no panel can be read any more."""

    @property
    def closed(self) -> bool:
        """Whether the room has been given back."""


class PanelsInMemory:
    """Panels as arrays."""

    def __init__(self, count: int) -> None:
        self._panels = [_NO_PANEL] * count

    @property
    def closed(self) -> bool:
        """Whether all of them have been given back."""
        return not self._panels

    def __getitem__(self, k: int) -> Float:
        return self._panels[k]

    def __setitem__(self, k: int, panel: Float) -> None:
        self._panels[k] = np.array(panel, order="F")

    def in_order(self, nodes: Sequence[int]) -> Iterator[tuple[int, Float]]:
        """Nodes with their panels."""
        return ((k, self._panels[k]) for k in nodes)

    def release(self, k: int) -> None:
        """Give back the memory of a panel."""
        self._panels[k] = _NO_PANEL

    def clear(self) -> None:
        """Give back all of it."""
        self._panels.clear()


class PanelsInFile:
    """Panels in one temporary file; threads take turns at it.

    Parameters
    ----------
    shapes : sequence of (int, int)
        Rows and columns of each panel.

    Raises
    ------
    ResourceError
        If there is no room for the file.
    """

    def __init__(self, shapes: Sequence[tuple[int, int]]) -> None:
        self._shapes = list(shapes)
        self._first = np.concatenate([[0], np.cumsum([8 * n * m for n, m in shapes])]).tolist()
        self._turn = Lock()
        try:
            self._file = tempfile.TemporaryFile(prefix="aatri-panels-", buffering=0)  # noqa: SIM115
        except OSError as error:
            raise _no_room(self._first[-1], error) from error
        self._closed = weakref.finalize(self, self._file.close)

    @property
    def closed(self) -> bool:
        """Whether the room has been given back."""
        return not self._closed.alive

    def __getitem__(self, k: int) -> Float:
        panel = np.empty(self._shapes[k], order="F")
        with self._turn:
            self._file.seek(self._first[k])
            rest = panel.T.data.cast("B")
            while rest:
                rest = rest[self._file.readinto(rest) :]
        return panel

    def __setitem__(self, k: int, panel: Float) -> None:
        with self._turn:
            try:
                self._file.seek(self._first[k])
                rest = panel.T.data.cast("B")
                while rest:
                    rest = rest[self._file.write(rest) :]
            except OSError as error:
                raise _no_room(self._first[-1], error) from error

    def in_order(self, nodes: Sequence[int]) -> Iterator[tuple[int, Float]]:
        """Nodes with their panels; the next is read while one is worked on."""
        with ThreadPoolExecutor(1) as reader:
            coming = [reader.submit(self.__getitem__, k) for k in nodes[:1]]
            for k, following in zip_longest(nodes, nodes[1:]):
                panel = coming.pop().result()
                if following is not None:
                    coming.append(reader.submit(self.__getitem__, following))
                yield k, panel

    def release(self, k: int) -> None:
        """Nothing is in memory."""

    def clear(self) -> None:
        """Give back the room."""
        self._closed()


def _no_room(size: int, error: OSError) -> ResourceError:
    return ResourceError(
        f"{tempfile.gettempdir()} has no room for the factor of {size / 1e9:.2g} GB ({error.strerror})",
        remedy="set TMPDIR to a larger disk, or memory_gb to more memory",
    )


def panels_of(tree: Tree, spill: bool) -> Panels:
    """Room for the panels of a tree, in memory or in a file."""
    if spill:
        return PanelsInFile([(node.size, node.panel) for node in tree.nodes])
    return PanelsInMemory(len(tree.nodes))
