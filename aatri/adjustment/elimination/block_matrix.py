"""Cholesky factor of a sparse symmetric matrix in blocks: its solution, and the diagonal of its inverse.

    M = s N s + diag(a) = L L'

with a scale s and an addition a for every row, N the same for many of them. Rows that belong together are a vertex of a
graph whose edges are the blocks of N that are not zero; vertices are eliminated in the order of nested dissection, each
in a dense front, and of the inverse only the blocks of the fronts are formed on the way back down.

Source: Takahashi, Fagan, Chen 1973 (parts of the inverse); aatri/adjustment/elimination/fronts.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from aatri.adjustment.elimination import lapack
from aatri.adjustment.structure.graph import Graph, nested_dissection
from aatri.adjustment.structure.tree import Tree, build_tree
from aatri.arrays import Float, Int


@dataclass(frozen=True)
class BlockMatrix:
    """A matrix N of n rows, laid out by the fronts that eliminate it."""

    tree: Tree
    columns: tuple[Float, ...]
    """Tuple of (rows of the front, columns it eliminates): what N has there."""

    def factor(self, scale: Float, added: Float) -> BlockFactor | None:
        """The factor of M; None where it is not positive definite.

        Parameters
        ----------
        scale, added : (n,) float64
            s and a.
        """
        panels: list[Float] = []
        updates: dict[int, Float] = {}
        for k, (node, columns) in enumerate(zip(self.tree.nodes, self.columns)):
            m, s = node.panel, scale[node.columns]
            F = np.zeros((node.size, node.size), order="F")
            F[:, :m] = columns * s[:, None] * s[:m]
            F[range(m), range(m)] += added[node.columns[:m]]
            for child in node.children:
                rows = self.tree.maps[child]
                F[np.ix_(rows, rows)] += updates.pop(child)
            if lapack.cholesky_panel(F, m):
                return None
            panels.append(np.array(F[:, :m], order="F"))
            updates[k] = F[m:, m:]
        return BlockFactor(self.tree, tuple(panels))


@dataclass(frozen=True)
class BlockFactor:
    """The factor L by fronts."""

    tree: Tree
    panels: tuple[Float, ...]

    @property
    def log_determinant(self) -> float:
        """Of M."""
        return 2.0 * sum(float(np.log(panel.diagonal()).sum()) for panel in self.panels)

    def solve(self, right: Float) -> Float:
        """M^-1 times a vector, (n,) float64."""
        x, parts = right.copy(), []
        for node, L in zip(self.tree.nodes, self.panels):
            part = x[node.columns]
            lapack.forward(L, part)
            x[node.columns] = part
            parts.append(part)
        for node, L, part in zip(self.tree.nodes[::-1], self.panels[::-1], parts[::-1]):
            part[node.panel :] = x[node.columns[node.panel :]]
            lapack.backward(L, part)
            x[node.columns[: node.panel]] = part[: node.panel]
        return x

    def inverse_diagonal(self) -> Float:
        """Diagonal of the inverse of M, (n,) float64."""
        nodes, boundary = self.tree.nodes, dict[int, Float]()
        diagonal = np.empty(sum(node.panel for node in nodes))
        for k in range(len(nodes) - 1, -1, -1):
            S = lapack.panel_covariance(self.panels[k], boundary.pop(k, np.zeros((0, 0), order="F")))
            diagonal[nodes[k].columns[: nodes[k].panel]] = S.diagonal()[: nodes[k].panel]
            for child in nodes[k].children:
                rows = self.tree.maps[child]
                boundary[child] = np.asfortranarray(S[np.ix_(rows, rows)])
        return diagonal


def block_matrix(N: csr_array, vertex: Int, position: Float) -> BlockMatrix:
    """Lay out a matrix.

    Parameters
    ----------
    N : (n, n) csr_array
        Symmetric.
    vertex : (n,) int
        Of every row, ascending.
    position : (n_vertices, d) float64
        By which they are ordered.
    """
    n, entries = len(position), N.tocoo()
    size = np.bincount(vertex, minlength=n)
    meet = np.zeros((n, n), dtype=bool)
    meet[vertex[entries.row], vertex[entries.col]] = True
    np.fill_diagonal(meet, val=False)
    start = np.concatenate([[0], np.cumsum(meet.sum(axis=1))])
    graph = Graph(start, np.nonzero(meet)[1].astype(np.int32))
    tree = build_tree(graph, nested_dissection(graph, position, leaf=1), size, np.cumsum(size) - size)
    return BlockMatrix(tree, tuple(N[node.columns][:, node.columns[: node.panel]].toarray() for node in tree.nodes))
