"""Essential matrices of five points in NumPy, by the action matrix: the reference of the compiled form.

Source: Nister, PAMI 26 (2004) 756; Stewenius, Engels & Nister, ISPRS Journal 60 (2006) 284.
"""

from __future__ import annotations

import itertools
from math import comb

import numpy as np

from aatri.arrays import Float, Int
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.intersection import projection_coefficients
from aatri.geometry.rotations import log_rotation

SAMPLES = 300
"""Samples of five points: with half the points wrong, one of them is free of errors with probability 0.9999."""

_CAUCHY = 3.0
_BEHIND = 100.0
_ALIKE = 0.02
_SEED = 5


def essential_starts(rays: RayPairs, *, most: int = 4) -> list[tuple[Float, Float]]:
    """Relative orientations that explain the points, the best first.

    Parameters
    ----------
    rays : RayPairs
        At least five points.
    most : int
        Orientations returned at most; they differ by more than 0.02 rad.

    Returns
    -------
    list of (left_from_right (3, 3), base (3,))
    """
    u1, u2 = (u / np.abs(u[:, 2:]) for u in (rays.left, rays.right))
    samples = _samples(len(u1))
    hypotheses = five_point(u1[samples], u2[samples])
    if not len(hypotheses):
        return []
    distance = _sampson_distances(hypotheses, rays)
    order = _different(hypotheses, np.argsort(_cost(distance), kind="stable"), 5 * most)
    ranked = sorted(
        (_best_decomposition(hypotheses[k], distance[k], rays) for k in order), key=lambda candidate: candidate[0]
    )
    chosen: list[tuple[Float, Float]] = []
    for _, R, b in ranked:
        if all(_differ(R, b, other) for other in chosen):
            chosen.append((R, b))
    return chosen[:most]


def five_point(left: Float, right: Float) -> Float:
    """Essential matrices of samples of five points.

    Parameters
    ----------
    left, right : (s, 5, 3) float64
        Ray directions in the left and right image, any length.

    Returns
    -------
    (h, 3, 3) float64, of Frobenius norm sqrt(2)
        All real solutions of all samples, in their order.
    """
    equations = (left[:, :, :, None] * right[:, :, None, :]).reshape(-1, 5, 9)
    null_space = np.linalg.svd(equations)[2][:, 5:].reshape(-1, 4, 3, 3)
    cubic = _cubic_equations(null_space)
    reduced = np.linalg.pinv(cubic[:, :, :10]) @ cubic[:, :, 10:]
    action = np.zeros((len(cubic), 10, 10))
    for row, source in enumerate(_TIMES_X):
        if source < 10:
            action[:, row] = -reduced[:, source]
        else:
            action[:, row, source - 10] = 1.0
    values, vectors = np.linalg.eig(action)
    scale = vectors[:, 9]
    real = (np.abs(values.imag) < 1e-9) & (np.abs(scale) > 1e-12)
    sample, solution = np.nonzero(real)
    xyz = (vectors[sample, 6:9, solution] / scale[sample, solution][:, None]).real
    E = np.einsum("hk,hkij->hij", np.column_stack([xyz, np.ones(len(xyz))]), null_space[sample])
    norm = np.linalg.norm(E, axis=(1, 2), keepdims=True)
    return np.asarray(np.sqrt(2.0) * E / norm)


def decompositions(E: Float) -> list[tuple[Float, Float]]:
    """The four (R, b) of an essential matrix E = -[b]x R, up to the sign of E.

    Parameters
    ----------
    E : (3, 3) float64
    """
    U, _, Vt = np.linalg.svd(E)
    U, Vt = U * np.sign(np.linalg.det(U)), Vt * np.sign(np.linalg.det(Vt))
    W = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return [(U @ w @ Vt, sign * U[:, 2]) for w in (W, W.T) for sign in (1.0, -1.0)]


# The twenty monomials of degree 3 and less in x, y, z (and 1), the ten of degree 3 first.
_MONOMIALS = sorted(
    {tuple(sorted(m)) for m in itertools.product(range(4), repeat=3)}, key=lambda m: (sum(k == 3 for k in m), m)
)
_PLACE = {monomial: k for k, monomial in enumerate(_MONOMIALS)}
_COLLECT = np.zeros((64, 20))
for _row, _m in enumerate(itertools.product(range(4), repeat=3)):
    _COLLECT[_row, _PLACE[tuple(sorted(_m))]] = 1.0
# Where x times each of the ten lower monomials (x^2 ... z^2, x, y, z, 1) stands among the twenty.
_TIMES_X = [_PLACE[tuple(sorted((0, *sorted(m)[:2])))] for m in _MONOMIALS[10:]]


def _cubic_equations(X: Float) -> Float:
    """Coefficients (s, 10, 20) of det E = 0 and 2 E E' E - tr(E E') E = 0 for E = sum of x_k X_k."""
    s = len(X)
    square = np.einsum("sapq,sbrq->sabpr", X, X)
    trace = np.einsum("sabpp->sab", square)
    cubic = 2.0 * np.einsum("sabpr,scrq->sabcpq", square, X) - np.einsum("sab,scpq->sabcpq", trace, X)
    minors = np.cross(X[:, :, None, 1], X[:, None, :, 2])
    determinant = np.einsum("sap,sbcp->sabc", X[:, :, 0], minors)
    terms = np.concatenate([cubic.reshape(s, 64, 9), determinant.reshape(s, 64, 1)], axis=2)
    return np.asarray(terms.swapaxes(1, 2) @ _COLLECT)


def _samples(n: int) -> Int:
    if comb(n, 5) <= SAMPLES:
        return np.array(list(itertools.combinations(range(n), 5)), dtype=np.intp)
    random = np.random.default_rng(_SEED)
    return np.argsort(random.random((SAMPLES, min(n, 2000))), axis=1)[:, :5] * n // min(n, 2000)


def _sampson_distances(E: Float, rays: RayPairs) -> Float:
    """(h, n) Sampson distances of all points for all hypotheses."""
    of_left, of_right = rays.right @ E.swapaxes(1, 2), rays.left @ E
    F = np.einsum("ni,hni->hn", rays.left, of_left)
    variance = (of_left[:, :, :2] ** 2 * rays.left_sigma**2).sum(axis=2)
    variance += (of_right[:, :, :2] ** 2 * rays.right_sigma**2).sum(axis=2)
    return np.asarray(F / np.sqrt(np.maximum(variance, 1e-300)))


def _cost(distance: Float) -> Float:
    return np.asarray(np.log1p((distance / _CAUCHY) ** 2).sum(axis=-1))


def _different(E: Float, order: Int, most: int) -> list[int]:
    """The first ones of an order that differ: over flat ground a wrong one, with points behind, has many doubles."""
    chosen: list[int] = []
    while len(order) and len(chosen) < most:
        chosen.append(int(order[0]))
        order = order[np.abs(np.einsum("hij,ij->h", E[order], E[order[0]])) < 2.0 * np.cos(_ALIKE)]
    return chosen


def _best_decomposition(E: Float, distance: Float, rays: RayPairs) -> tuple[float, Float, Float]:
    """Cost, rotation and base of the decomposition with most points in front."""
    ranked = []
    for R, b in decompositions(E):
        depth = projection_coefficients(rays.left, rays.right @ R.T, b)
        front = (depth > 0).all(axis=1)
        ranked.append((float(_cost(np.where(front, distance, _BEHIND))), R, b))
    return min(ranked, key=lambda candidate: candidate[0])


def _differ(R: Float, b: Float, other: tuple[Float, Float]) -> bool:
    turned = np.linalg.norm(log_rotation(R @ other[0].T))
    return bool(turned > 0.02 or np.linalg.norm(b - other[1]) > 0.02)
