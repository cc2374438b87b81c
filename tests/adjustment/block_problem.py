"""A small made-up adjustment with kept and eliminated blocks, held scalars and full covariances."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.records import Records, whitener_of_covariances
from aatri.adjustment.unknowns import Unknowns, add_step


def made_problem(seed: int = 0, *, n_kept: int = 5, n_points: int = 12, rays: int = 3):
    """Non-linear observations v = f(a, p) of kept blocks a (4) and eliminated blocks p (3); some scalars are held."""
    rng = np.random.default_rng(seed)
    kept = np.concatenate([rng.permutation(n_kept)[:rays] for _ in range(n_points)]).astype(np.int32)
    point = np.repeat(np.arange(n_points), rays).astype(np.int32)
    B = rng.normal(size=(len(kept), 2, 4))
    C = rng.normal(size=(len(kept), 2, 3))
    target = rng.normal(size=(len(kept), 2))
    half = rng.normal(size=(len(kept), 2, 2))
    covariance = half @ half.swapaxes(1, 2) + 0.2 * np.eye(2)

    def evaluate(state, rows):
        a, p = state["a"][kept[rows]], state["p"][point[rows]]
        linear = np.einsum("nij,nj->ni", B[rows], a) + np.einsum("nij,nj->ni", C[rows], p)
        slope = 1 + 0.05 * np.cos(linear)
        return linear + 0.05 * np.sin(linear) - target[rows], (slope[:, :, None] * B[rows], slope[:, :, None] * C[rows])

    def prior(state, rows):
        return state["a"][rows] - 0.3, (np.broadcast_to(np.eye(4), (len(rows), 4, 4)),)

    free_a, free_p = np.ones((n_kept, 4), bool), np.ones((n_points, 3), bool)
    free_a[1, 2] = free_p[4, 1] = False
    free_p[7] = False
    unknowns = (
        Unknowns("p", free_p, ("X", "Y", "Z"), [f"p{k}" for k in range(n_points)], add_step, eliminated=True),
        Unknowns("a", free_a, ("a1", "a2", "a3", "a4"), [f"a{k}" for k in range(n_kept)], add_step),
    )
    active = np.ones(len(kept), dtype=bool)
    active[2] = False
    records = (
        Records("ray", (("a", kept), ("p", point)), evaluate, whitener_of_covariances(covariance), active),
        Records("prior", (("a", np.arange(n_kept, dtype=np.int32)),), prior,
                whitener_of_covariances(np.tile(np.diag([1.0, 2.0, 3.0, 4.0]), (n_kept, 1, 1))), np.ones(n_kept, bool)),
    )  # fmt: skip
    start = {"a": np.zeros((n_kept, 4)), "p": np.zeros((n_points, 3))}
    return unknowns, records, start
