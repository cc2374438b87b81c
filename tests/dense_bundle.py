"""A bundle with inner constraints in dense matrices, derivatives by complex step: what the core is held against.

    x = -c u1/u3, ...  u = R'(X - X0),      q = measured - (x0, y0),   v = x - (q + Brown(q))

written out per ray without the package. Q from the bordered normal equations [[N, B], [B', 0]], B the shifts, rotations
(and the scale, where nothing gives it) over all points.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

Array = np.ndarray

STEP = 1e-30


def cross(a: Array) -> Array:
    """[a]x of (n, 3)."""
    zero = np.zeros_like(a[:, 0])
    rows = [zero, -a[:, 2], a[:, 1], a[:, 2], zero, -a[:, 0], -a[:, 1], a[:, 0], zero]
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def brown_residual(z: Array, R: Array, xy: Array, shared: Array) -> Array:
    """Residuals (n, 2) of rays with z = X0 d X of each, (n, 9), and camera c x0 y0 k1 k2 k3 p1 p2 b1 b2 of each."""
    turned = R + cross(z[:, 3:6]) @ R
    u = np.einsum("nji,nj->ni", turned, z[:, 6:9] - z[:, :3])
    c, x0, y0, k1, k2, k3, p1, p2, b1, b2 = shared.T
    x, y = xy[:, 0] - x0, xy[:, 1] - y0
    s = x * x + y * y
    radial = k1 * s + k2 * s * s + k3 * s * s * s
    dx = x * radial + p1 * (s + 2 * x * x) + 2 * p2 * x * y + b1 * x + b2 * y
    dy = y * radial + p2 * (s + 2 * y * y) + 2 * p1 * x * y
    return np.stack([-c * u[:, 0] / u[:, 2] - x - dx, -c * u[:, 1] / u[:, 2] - y - dy], axis=1)


def by_complex_step(f: Callable[[Array], Array], z: Array) -> Array:
    """Derivatives (n, m, k) of f(z) (n, m) by z (n, k), row by row."""
    columns = []
    for k in range(z.shape[1]):
        moved = z.astype(complex)
        moved[:, k] += 1j * STEP
        columns.append(f(moved).imag / STEP)
    return np.stack(columns, axis=2)


@dataclass
class Dense:
    """Normal equations of n unknowns, taken up observation by observation."""

    N: Array

    @staticmethod
    def of(n: int) -> Dense:
        return Dense(np.zeros((n, n)))

    def add(self, J: Array, columns: Array, sigma: Array) -> None:
        """Records with J (n, m, k) at columns (n, k), independent sigma (n, m)."""
        W = J / sigma[:, :, None]
        NN = np.einsum("nmi,nmj->nij", W, W)
        np.add.at(self.N, (columns[:, :, None], columns[:, None, :]), NN)

    def covariance(self, B: Array) -> Array:
        """Q with inner constraints B (n, d); unknowns are scaled to unit diagonal before."""
        d = 1.0 / np.sqrt(np.diag(self.N))
        scaled, border = self.N * np.outer(d, d), B * d[:, None]
        border = np.linalg.qr(border)[0]
        k = border.shape[1]
        whole = np.block([[scaled, border], [border.T, np.zeros((k, k))]])
        return np.linalg.inv(whole)[: len(d), : len(d)] * np.outer(d, d)


def inner_constraints(n: int, first: int, X: Array, scale: bool = False) -> Array:
    """B over points whose unknowns begin at `first`: shifts, rotations and, if wanted, the scale."""
    B = np.zeros((n, 7 if scale else 6))
    X = X - X.mean(axis=0)
    rows = first + 3 * np.arange(len(X))
    for a in range(3):
        B[rows + a, a] = 1.0
        B[rows[:, None] + np.arange(3), 3 + a] = np.cross(np.eye(3)[a], X)
        if scale:
            B[rows + a, 6] = X[:, a]
    return B


def correlations(Q: Array) -> Array:
    """Of a covariance matrix."""
    s = np.sqrt(np.diag(Q))
    return Q / np.outer(s, s)


def blocks(Q: Array, first: int, size: int, count: int) -> Array:
    """Diagonal blocks (count, size, size)."""
    at: Sequence[slice] = [slice(first + size * k, first + size * (k + 1)) for k in range(count)]
    return np.array([Q[a, a] for a in at])
