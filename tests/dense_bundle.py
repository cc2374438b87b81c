"""A bundle with inner constraints in dense matrices, derivatives by complex step: what the core is held against.

    x = -c u1/u3, ...  u = R'(X - X0),      q = measured - (x0, y0),   v = x - (q + Brown(q))

written out per ray without the package. Q from the bordered normal equations [[N, B], [B', 0]], B the shifts, rotations
(and the scale, where nothing gives it) over all points. With control `least_squares` iterates to the end:

    x <- x - N^-1 J'P v(x),      N = J'P J
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


@dataclass(frozen=True)
class Rows:
    """Observations of one kind: residuals (n, m) of the unknowns z (n, k) at `columns` (n, k), and sigma (n, m)."""

    residual: Callable[[Array], Array]
    columns: Array
    sigma: Array


def rotation(angles: Array) -> Array:
    """R = R1(omega) R2(phi) R3(kappa), (n, 3, 3), from angles (n, 3)."""
    zero, one = np.zeros_like(angles[:, 0]), np.ones_like(angles[:, 0])
    (so, sp, sk), (co, cp, ck) = np.sin(angles).T, np.cos(angles).T
    R1 = np.stack([one, zero, zero, zero, co, -so, zero, so, co], axis=1).reshape(-1, 3, 3)
    R2 = np.stack([cp, zero, sp, zero, one, zero, -sp, zero, cp], axis=1).reshape(-1, 3, 3)
    R3 = np.stack([ck, -sk, zero, sk, ck, zero, zero, zero, one], axis=1).reshape(-1, 3, 3)
    return R1 @ R2 @ R3


def projected(z: Array, c: float) -> Array:
    """Central projection (n, 2) with z = X0, omega phi kappa, X of each ray, (n, 9)."""
    u = np.einsum("nji,nj->ni", rotation(z[:, 3:6]), z[:, 6:9] - z[:, :3])
    return -c * u[:, :2] / u[:, 2:]


def least_squares(x: Array, rows_at: Callable[[Array], Sequence[Rows]]) -> tuple[Array, Array]:
    """Unknowns and Q where Gauss and Newton end; rows may depend on the unknowns of the step before."""
    for _ in range(30):
        dense, g = Dense.of(len(x)), np.zeros(len(x))
        for rows in rows_at(x):
            v, J = rows.residual(x[rows.columns]), by_complex_step(rows.residual, x[rows.columns])
            dense.add(J, rows.columns, rows.sigma)
            np.add.at(g, rows.columns, np.einsum("nmk,nm->nk", J, v / rows.sigma**2))
        scale = 1.0 / np.sqrt(np.diag(dense.N))
        Q = np.linalg.inv(dense.N * np.outer(scale, scale)) * np.outer(scale, scale)
        step = Q @ g
        x = x - step
        if (np.abs(step) < 1e-9 * np.sqrt(np.diag(Q))).all():
            break
    return x, Q


def ebner12(xy: Array) -> Array:
    """Ebner's columns (n, 2, 12), x and y in photo bases."""
    (x, y), o = xy.T, 0 * xy[:, 0]
    u, v = x * x - 2 / 3, y * y - 2 / 3
    dx = [x, y, -2 * u, x * y, v, o, x * v, o, y * u, o, u * v, o]
    dy = [-y, x, x * y, -2 * v, o, u, o, y * u, o, x * v, o, u * v]
    return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)


def bauer3(xy: Array, r0: float) -> Array:
    """Bauer's columns (n, 2, 3); x, y and r0 in half diagonals."""
    (x, y), o = xy.T, 0 * xy[:, 0]
    radial = x * x + y * y - r0 * r0
    return np.stack([np.stack([x * radial, o, -x], axis=1), np.stack([y * radial, x, y], axis=1)], axis=1)


def brown_conrady(xy: Array, c: float) -> Array:
    """Columns of c x0 y0 k1 k2 k3 p1 p2 b1 b2 (n, 2, 10); x, y and c in half diagonals."""
    (x, y), o = xy.T, 0 * xy[:, 0]
    s = x * x + y * y
    dx = [-x / c, o - 1, o, x * s, x * s**2, x * s**3, s + 2 * x * x, 2 * x * y, x, y]
    dy = [-y / c, o, o - 1, y * s, y * s**2, y * s**3, 2 * x * y, s + 2 * y * y, o, o]
    return np.stack([np.stack(dx, axis=1), np.stack(dy, axis=1)], axis=1)
