"""The map of a block, and its axes, as functions of coordinates in the tangent frame: smooth, differentiable, fast.

    x(X) = x_k + D d + d'H d / 2,    B(X) = B_k + (dB/dX) d,    d = X - X_k

X_k are the nodes of a net of 50 m: there everything is computed once. Between them the error is some nm in x and 1e-10
in B, and there is none of the rounding of a map's large coordinates, steps of 1e-9 m from place to place.
x is less a reference. Works on complex numbers too.
"""

from typing import Any

import numpy as np

from aatri.arrays import Float, Int
from aatri.frames.tangent import STEP_M, TangentFrame

NET_M = 50.0
"""Mesh of the net."""


class Expanded:
    """Coordinates and axes of the block about the nodes that have been asked for.

    Parameters
    ----------
    reference : (3,) float64, m
        Subtracted from the coordinates of the block.
    """

    def __init__(self, frame: TangentFrame, reference: Float) -> None:
        self.frame, self.reference = frame, reference
        self._place: dict[tuple[float, ...], int] = {}
        self._x, self._D, self._H = np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3, 3, 3))
        self._B, self._dB = np.zeros((0, 3, 3)), np.zeros((0, 3, 3, 3))

    def coordinates(self, X: Any) -> tuple[Any, Any]:
        """x less the reference (n, 3), and its derivatives (n, 3, 3), at places (n, 3) of the tangent frame."""
        k, d = self._node(X)
        bent = np.einsum("nijk,nk->nij", self._H[k], d)
        D = self._D[k] + bent
        return self._x[k] + np.einsum("nij,nj->ni", self._D[k] + 0.5 * bent, d), D

    def axes(self, X: Any) -> tuple[Any, Any]:
        """Grid east, grid north, up as rows (n, 3, 3), and their derivatives (n, 3, 3, 3), the last index that of X."""
        k, d = self._node(X)
        return self._B[k] + np.einsum("nijk,nk->nij", self._dB[k], d), self._dB[k]

    def _node(self, X: Any) -> tuple[Int, Any]:
        finite = np.isfinite(X).all(axis=1)
        node = np.round(np.where(finite[:, None], X.real, 0.0) / NET_M) * NET_M
        nodes, number = np.unique(node, axis=0, return_inverse=True)
        new = np.array([n for n in nodes if tuple(n) not in self._place]).reshape(-1, 3)
        if len(new):
            self._add(new)
        place = np.array([self._place[tuple(n)] for n in nodes], dtype=np.int64)
        return place[number.reshape(-1)], X - node

    def _add(self, nodes: Float) -> None:
        frame, first = self.frame, len(self._x)
        steps = STEP_M * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        places = (nodes + steps[:, None]).reshape(-1, 3)
        derivatives = frame.derivatives_at(places)
        D, B = (a.reshape(7, -1, 3, 3) for a in (derivatives, frame.axes_of(derivatives, places).swapaxes(1, 2)))
        H, dB = (np.moveaxis(a[1:4] - a[4:], 0, -1) / (2 * STEP_M) for a in (D, B))
        self._x = np.concatenate([self._x, frame.to_block(nodes) - self.reference])
        self._D = np.concatenate([self._D, D[0]])
        self._H = np.concatenate([self._H, 0.5 * (H + H.swapaxes(2, 3))])
        self._B = np.concatenate([self._B, B[0]])
        self._dB = np.concatenate([self._dB, dB])
        self._place |= {tuple(n): first + k for k, n in enumerate(nodes)}
