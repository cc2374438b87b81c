"""Small made-up adjustments with kept and eliminated blocks, held scalars and full covariances."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.adjustment.whitening import whitener_of_covariances


def _rays(rng: np.random.Generator, n_kept: int, n_points: int, rays):
    """Each point meets some neighbouring kept blocks, so that the graph has a shape."""
    first = rng.integers(0, n_kept - rays + 1, n_points)
    kept = (first[:, None] + np.arange(rays)).ravel().astype(np.int32)
    return kept, np.repeat(np.arange(n_points), rays).astype(np.int32)


def _covariances(rng: np.random.Generator, n: int):
    half = rng.normal(size=(n, 2, 2))
    return half @ half.swapaxes(1, 2) + 0.2 * np.eye(2)


def _observed(rng: np.random.Generator, groups, touches):
    """Mildly non-linear observations of the touched blocks."""
    n = len(touches[0])
    B = [rng.normal(size=(n, 2, size)) for _, size in groups]
    target = rng.normal(size=(n, 2))

    def evaluate(state, rows):
        linear = sum(
            np.einsum("nij,nj->ni", b[rows], state[name][t[rows]]) for b, (name, _), t in zip(B, groups, touches)
        )
        slope = (1 + 0.05 * np.cos(linear))[:, :, None]
        return linear + 0.05 * np.sin(linear) - target[rows], tuple(slope * b[rows] for b in B)

    return evaluate


def _prior(name: str, n: int, size, value=0.3):
    def evaluate(state, rows):
        return state[name][rows] - value, (np.broadcast_to(np.eye(size), (len(rows), size, size)),)

    covariance = np.tile(np.diag(np.arange(1.0, size + 1)), (n, 1, 1))
    whitener = whitener_of_covariances(covariance)
    return Records(f"prior of {name}", ((name, np.arange(n, dtype=np.int32)),), evaluate, whitener, np.ones(n, bool))


def _group(name: str, free, **more):
    n, k = free.shape
    labels = tuple(f"{name}{i + 1}" for i in range(k))
    return Unknowns(name, free, labels, [f"{name}{i}" for i in range(n)], add_step, **more)


def _along(n: int):
    return np.column_stack([np.arange(n, dtype=float), np.zeros(n)])


def made_problem(seed: int = 0, *, n_kept: int = 5, n_points: int = 12, rays: int = 3):
    """Observations of kept blocks a (4) and eliminated blocks p (3); some scalars are held; priors of a."""
    rng = np.random.default_rng(seed)
    kept, point = _rays(rng, n_kept, n_points, rays)
    evaluate = _observed(rng, (("a", 4), ("p", 3)), (kept, point))
    free_a, free_p = np.ones((n_kept, 4), bool), np.ones((n_points, 3), bool)
    free_a[1, 2] = free_p[4, 1] = False
    free_p[7] = False
    active = np.ones(len(kept), dtype=bool)
    active[2] = False
    touches = (("a", kept), ("p", point))
    records = (
        Records("ray", touches, evaluate, whitener_of_covariances(_covariances(rng, len(kept))), active),
        _prior("a", n_kept, 4),
    )
    unknowns = (_group("p", free_p, eliminated=True), _group("a", free_a, position=_along(n_kept)))
    return unknowns, records, {"a": np.zeros((n_kept, 4)), "p": np.zeros((n_points, 3))}


def posed_problem(seed: int = 0, *, n_kept: int = 5, n_points: int = 12, rays: int = 3):
    """Observations of kept blocks a (6) and eliminated blocks p (3), as of single poses; priors of a."""
    rng = np.random.default_rng(seed)
    kept, point = _rays(rng, n_kept, n_points, rays)
    evaluate = _observed(rng, (("a", 6), ("p", 3)), (kept, point))
    records = (
        Records(
            "ray",
            (("a", kept), ("p", point)),
            evaluate,
            whitener_of_covariances(_covariances(rng, len(kept))),
            np.ones(len(kept), bool),
        ),
        _prior("a", n_kept, 6),
    )
    unknowns = (
        _group("a", np.ones((n_kept, 6), bool), position=_along(n_kept)),
        _group("p", np.ones((n_points, 3), bool), eliminated=True),
    )
    return unknowns, records, {"a": np.zeros((n_kept, 6)), "p": np.zeros((n_points, 3))}


def joined_problem(seed: int = 0, *, n_kept: int = 5, n_points: int = 12, rays: int = 3):
    """Kept blocks a (6) that another group f (2) joins, one f held; some points observed directly; a relation of a."""
    rng = np.random.default_rng(seed)
    kept, point = _rays(rng, n_kept, n_points, rays)
    evaluate = _observed(rng, (("a", 6), ("f", 2), ("p", 3)), (kept, kept, point))
    free_f = np.ones((n_kept, 2), bool)
    free_f[2] = False
    touches = (("a", kept), ("f", kept), ("p", point))
    ones = np.ones(len(kept), dtype=bool)
    here, there = np.arange(n_kept - 1, dtype=np.int32), np.arange(1, n_kept, dtype=np.int32)
    relation = _observed(rng, (("a", 6), ("a", 6)), (here, there))
    some = np.arange(0, n_points, 3, dtype=np.int32)
    direct = _prior("p", n_points, 3)
    records = (
        Records("ray", touches, evaluate, whitener_of_covariances(_covariances(rng, len(kept))), ones),
        _prior("a", n_kept, 6),
        _prior("f", n_kept, 2),
        Records(
            "given",
            (("p", some),),
            lambda s, r: direct.evaluate(s, some[r]),
            direct.whitener[some],
            np.ones(len(some), bool),
        ),
        Records(
            "relation",
            (("a", here), ("a", there)),
            relation,
            whitener_of_covariances(_covariances(rng, len(here))),
            np.ones(len(here), bool),
        ),
    )
    unknowns = (
        _group("a", np.ones((n_kept, 6), bool), position=_along(n_kept)),
        _group("f", free_f, joins="a"),
        _group("p", np.ones((n_points, 3), bool), eliminated=True),
    )
    start = {"a": np.zeros((n_kept, 6)), "f": np.zeros((n_kept, 2)), "p": np.zeros((n_points, 3))}
    return unknowns, records, start


def shared_problem(seed: int = 0, *, n_kept: int = 5, n_points: int = 12, rays: int = 3):
    """Kept blocks a (6), two shared blocks c (3) that all rays meet, two points that another observation joins."""
    rng = np.random.default_rng(seed)
    kept, point = _rays(rng, n_kept, n_points, rays)
    camera = (kept % 2).astype(np.int32)
    evaluate = _observed(rng, (("a", 6), ("c", 3), ("p", 3)), (kept, camera, point))
    touches = (("a", kept), ("c", camera), ("p", point))
    first, second = np.array([3], dtype=np.int32), np.array([8], dtype=np.int32)
    distance = _observed(rng, (("p", 3), ("p", 3)), (first, second))
    records = (
        Records(
            "ray",
            touches,
            evaluate,
            whitener_of_covariances(_covariances(rng, len(kept))),
            np.ones(len(kept), dtype=bool),
        ),
        _prior("a", n_kept, 6),
        _prior("c", 2, 3),
        Records(
            "distance",
            (("p", first), ("p", second)),
            distance,
            whitener_of_covariances(_covariances(rng, 1)),
            np.ones(1, bool),
        ),
    )
    unknowns = (
        _group("a", np.ones((n_kept, 6), bool), position=_along(n_kept)),
        _group("c", np.ones((2, 3), bool)),
        _group("p", np.ones((n_points, 3), bool), eliminated=True),
    )
    start = {"a": np.zeros((n_kept, 6)), "c": np.zeros((2, 3)), "p": np.zeros((n_points, 3))}
    return unknowns, records, start


def halves_problem(seed: int = 0):
    """Two halves of kept blocks a (4) and eliminated blocks p (3) that one scalar c alone joins; priors of a and c."""
    rng = np.random.default_rng(seed)
    n_kept, n_points = 8, 24
    (k1, p1), (k2, p2) = (_rays(rng, n_kept // 2, n_points // 2, 3) for _ in range(2))
    kept = np.concatenate([k1, k2 + n_kept // 2]).astype(np.int32)
    point = np.concatenate([p1, p2 + n_points // 2]).astype(np.int32)
    camera = np.zeros(len(kept), dtype=np.int32)
    evaluate = _observed(rng, (("a", 4), ("c", 1), ("p", 3)), (kept, camera, point))
    records = (
        Records(
            "ray",
            (("a", kept), ("c", camera), ("p", point)),
            evaluate,
            whitener_of_covariances(_covariances(rng, len(kept))),
            np.ones(len(kept), dtype=bool),
        ),
        _prior("a", n_kept, 4),
        _prior("c", 1, 1),
    )
    unknowns = (
        _group("a", np.ones((n_kept, 4), bool), position=_along(n_kept)),
        _group("c", np.ones((1, 1), bool)),
        _group("p", np.ones((n_points, 3), bool), eliminated=True),
    )
    return unknowns, records, {"a": np.zeros((n_kept, 4)), "c": np.zeros((1, 1)), "p": np.zeros((n_points, 3))}
