"""Bundle Adjustment in the Large with Huber's loss by other means: an optimum to compare the bundle with.

Nothing of aatri is used: the file's own camera model, angles and axes, derivatives by complex step, sparse normal
equations by SciPy, plain Levenberg-Marquardt from the file's start. A record v of two pixels with s = |v| enters as the
least-squares record

    v phi(s) / s,    phi^2 = s^2 (s <= k),    phi^2 = 2 k s - k^2 (s > k)

whose sum of squares is the robust cost itself, with neither weights nor second-order terms.

    python -m tests.campaigns.bal_with_loss problem-49-7776-pre.txt [k]
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import bsr_matrix, csr_matrix, diags


def read(path: Path) -> tuple[Any, Any, Any, Any, Any]:
    """Cameras (n, 9) and points (p, 3) as in the file, camera and point of each observation, measured pixels."""
    numbers = np.array(path.read_text(encoding="ascii").split(), dtype=float)
    n, p, m = numbers[:3].astype(int)
    table = numbers[3 : 3 + 4 * m].reshape(m, 4)
    rest = numbers[3 + 4 * m :]
    return rest[: 9 * n].reshape(n, 9), rest[9 * n :].reshape(p, 3), *table[:, :2].T.astype(int), table[:, 2:]


def residual(camera: Any, X: Any, xy: Any) -> Any:
    """Computed minus measured, (m, 2), pixels: P = R X + t, p = -P / P.z, f (1 + k1 |p|^2 + k2 |p|^4) p."""
    w = camera[:, :3]
    angle = np.sqrt((w * w).sum(axis=1))[:, None]
    axis = w / angle
    cos, sin = np.cos(angle), np.sin(angle)
    turned = X * cos + np.cross(axis, X) * sin + axis * (axis * X).sum(axis=1)[:, None] * (1 - cos)
    P = turned + camera[:, 3:6]
    p = -P[:, :2] / P[:, 2:]
    r2 = (p * p).sum(axis=1)
    return (camera[:, 6] * (1 + camera[:, 7] * r2 + camera[:, 8] * r2**2))[:, None] * p - xy


def robust(v: Any, k: float) -> Any:
    """The least-squares record whose square is the cost of v."""
    s = np.sqrt((v * v).sum(axis=1))
    far = s.real > k
    factor = np.where(far, np.sqrt(np.where(far, 2 * k * s - k * k, 1.0)) / np.where(far, s, 1.0), 1.0)
    return v * factor[:, None]


def linearised(cameras: Any, points: Any, of: Any, to: Any, xy: Any, k: float) -> tuple[Any, Any]:
    """Robust residuals (2 m,) and their sparse Jacobian, cameras first."""
    m, n = len(xy), len(cameras)
    v = robust(residual(cameras[of], points[to], xy), k).ravel()
    values = np.concatenate([cameras[of], points[to]], axis=1).astype(complex)
    J = np.empty((m, 2, 12))
    for c in range(12):
        step = np.zeros(12, dtype=complex)
        step[c] = 1e-30j
        moved = values + step
        J[:, :, c] = robust(residual(moved[:, :9], moved[:, 9:], xy), k).imag / 1e-30
    columns = np.concatenate([9 * of[:, None] + np.arange(9), 9 * n + 3 * to[:, None] + np.arange(3)], axis=1)
    rows = np.repeat(np.arange(2 * m), 12)
    matrix = csr_matrix(
        (J.ravel(), (rows, np.repeat(columns[:, None], 2, axis=1).ravel())), (2 * m, cameras.size + points.size)
    )
    return v, matrix


def solved(N: Any, b: Any, n: int) -> Any:
    """N x = b by elimination of the points, which come after the first n unknowns."""
    B = N[:n, n:]
    D = N[n:, n:].tobsr((3, 3))
    D.sum_duplicates()
    inverse = bsr_matrix((np.linalg.inv(D.data), D.indices, D.indptr))
    S = (N[:n, :n] - B @ inverse @ B.T).toarray()
    x = np.linalg.solve(S, b[:n] - B @ (inverse @ b[n:]))
    return np.concatenate([x, inverse @ (b[n:] - B.T @ x)])


def optimum(path: Path, k: float, steps: int = 300) -> float:
    """Half the robust cost at the end of a Levenberg-Marquardt iteration from the file's start; prints its way."""
    cameras, points, of, to, xy = read(path)
    damping, growth, flat = 1e-4, 2.0, 0
    v, J = linearised(cameras, points, of, to, xy, k)
    for step in range(steps):
        N, g = (J.T @ J).tocsr(), J.T @ v
        dx = solved(N + damping * diags(N.diagonal()), -g, cameras.size)
        tried = cameras + dx[: cameras.size].reshape(-1, 9), points + dx[cameras.size :].reshape(-1, 3)
        cost = float((robust(residual(tried[0][of], tried[1][to], xy), k) ** 2).sum())
        gain = (float(v @ v) - cost) / float(dx @ (damping * N.diagonal() * dx - g))
        print(f"{step}: {v @ v / 2:.6f} damping {damping:.1e} gain {gain:.2f}", flush=True)  # noqa: T201
        if not gain > 0:
            damping, growth = damping * growth, 2 * growth
            continue
        flat = flat + 1 if v @ v - cost < 1e-8 * cost else 0
        (cameras, points), growth = tried, 2.0
        damping = max(damping * max(1 / 3, 1 - (2 * gain - 1) ** 3), 1e-15)
        v, J = linearised(cameras, points, of, to, xy, k)
        if flat == 5:
            break
    return float(v @ v) / 2


if __name__ == "__main__":
    print(optimum(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 1.0))  # noqa: T201
