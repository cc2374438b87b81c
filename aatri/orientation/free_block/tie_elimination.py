"""Normal equations of strips tied by common points, the ground points eliminated.

A strip's point, transformed to the ground with the strip's unknowns t, and a control point are both observations x_o of
the same unknown ground point X: v_o = X - x_o(t), weight W_o; control has no unknowns. With S = sum W_o over the
observations of the point, X = S^-1 sum W_o x_o, and with J = dx/dt what remains for t is

    B_o = J_o - S^-1 sum_p W_p J_p,
    N = sum B'W B = sum_o J_o'W_o J_o - sum_(o,p) (W_o J_o)' S^-1 W_p J_p,   g = sum B'W v = sum J'W v,

(o, p) running over the pairs of observations of each point. For k strips of equal weight this is the factor
(I - 11'/k): own block (k-1)/k, mutual block -1/k, for any number of strips (docs/formulas.md 4.3).

Cofactors of the residuals: Qvv = W_o^-1 - S^-1 - B_o Q B_o' with Q = N^-1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int

EXACT = 1e-2
"""Standard deviation of exact control, as a share of that of the strips' points: its residuals stay below 1e-4 of the
discrepancies, and its redundancy can still be told from rounding."""


@dataclass(frozen=True)
class Control:
    """Given ground coordinates.

    Attributes
    ----------
    point : (n,) int
        Number of the point.
    xyz_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
        Zero where exact.
    given : (n, 3) bool
        Coordinates that are control: all, plan only, height only.
    """

    point: Int
    xyz_m: Float
    covariance_m2: Float
    given: Bool


@dataclass(frozen=True)
class Observations:
    """Observations of ground points: first those of strips, then control.

    Attributes
    ----------
    strip : (n,) int
        Number of the strip; -1 for control.
    block : (n,) int
        Block of unknowns an observation depends on; -1 for control and for a strip that is held.
    point : (n,) int
        Number of the point, 0 ... n_points - 1.
    given : (n, 3) bool
        Coordinates observed; all of them in strips.
    n_points, n_blocks : int
    pairs : tuple of (int, int, (m,) int, (m,) int)
        Per two blocks a, b: rows o of a and p of b that observe the same point, every such pair once, o = p among them.
    """

    strip: Int
    block: Int
    point: Int
    given: Bool
    n_points: int
    n_blocks: int
    pairs: tuple[tuple[int, int, Int, Int], ...]


@dataclass(frozen=True)
class Linearised:
    """Observed ground coordinates in terms of the unknowns.

    Attributes
    ----------
    xyz_m : (n, 3) float64, m
    jacobian : (n, 3, u) float64
        Derivatives by the unknowns of the observation's block.
    covariance_m2 : (n, 3, 3) float64, m^2
        A priori.
    """

    xyz_m: Float
    jacobian: Float
    covariance_m2: Float


@dataclass(frozen=True)
class Eliminated:
    """The problem with its points eliminated.

    Attributes
    ----------
    point_m : (n_points, 3) float64, m
        NaN where no active observation in a strip is.
    point_covariance_m2 : (n_points, 3, 3) float64, m^2
        S^-1; NaN there.
    v : (n, 3) float64
        Whitened residuals; NaN at points without an active observation in a strip.
    whitening : (n, 3, 3) float64
        T with T'T = W.
    jacobian : (n, 3, u) float64
    share : (n, 3, u) float64
        S^-1 W_o J_o; zero where not active.
    N : (n_blocks u, n_blocks u) float64
    g : (n_blocks u,) float64
    """

    point_m: Float
    point_covariance_m2: Float
    v: Float
    whitening: Float
    jacobian: Float
    share: Float
    N: Float
    g: Float


def observations_of(
    strip: Int, point: Int, n_points: int, control: Control | None = None, held: int | None = None
) -> Observations:
    """Observations of strips' points, followed by control.

    Parameters
    ----------
    strip, point : (n,) int
    n_points : int
    control : Control, optional
    held : int, optional
        A strip without unknowns; those after it move up by one block.
    """
    n_blocks = int(strip.max(initial=-1)) + 1
    given = np.ones((len(strip), 3), dtype=bool)
    if control is not None:
        strip = np.concatenate([strip, np.full(len(control.point), -1)])
        point = np.concatenate([point, control.point])
        given = np.concatenate([given, control.given])
    block = strip.copy()
    if held is not None:
        block = np.where(strip == held, -1, strip - (strip > held))
        n_blocks -= 1
    return Observations(strip, block, point, given, n_points, n_blocks, _pairs(point, block, n_blocks))


def _pairs(point: Int, block: Int, n_blocks: int) -> tuple[tuple[int, int, Int, Int], ...]:
    rows = np.flatnonzero(block >= 0)
    rows = rows[np.argsort(point[rows], kind="stable")]
    first, second = [rows], [rows]
    for step in range(1, int(np.bincount(point[rows]).max(initial=0))):
        same = point[rows[:-step]] == point[rows[step:]]
        first += [rows[:-step][same], rows[step:][same]]
        second += [rows[step:][same], rows[:-step][same]]
    o, p = np.concatenate(first), np.concatenate(second)
    key = block[o] * n_blocks + block[p]
    order = np.lexsort((p, o, key))
    o, p, key = o[order], p[order], key[order]
    starts = np.flatnonzero(np.diff(key, prepend=-1))
    bounds = zip(starts, [*starts[1:], len(key)])
    return tuple((int(key[a] // n_blocks), int(key[a] % n_blocks), o[a:b], p[a:b]) for a, b in bounds)


def eliminate(observations: Observations, linear: Linearised, use: Bool, tau_m: float) -> Eliminated:
    """Eliminate the ground points.

    Parameters
    ----------
    observations : Observations
    linear : Linearised
    use : (n,) bool
        Active observations. Points without one in a strip take no part: their control counts for nothing.
    tau_m : float, m
        Added to the standard deviation of the strips' points.
    """
    o = observations
    held = np.zeros(o.n_points, dtype=bool)
    held[o.point[use & (o.strip >= 0)]] = True
    T = whitening(o, linear.covariance_m2, tau_m)
    W = np.where((use & held[o.point])[:, None, None], T.swapaxes(1, 2) @ T, 0.0)
    total = _summed(W, o.point, o.n_points)
    total[~held] = np.eye(3)
    covariance: Float = np.linalg.inv(total).astype(np.float64)
    # Reduced to the point's first observation, so that the mean keeps the digits of small discrepancies.
    base = np.zeros((o.n_points, 3))
    base[o.point[o.strip >= 0][::-1]] = linear.xyz_m[o.strip >= 0][::-1]
    pull = _summed(np.einsum("nij,nj->ni", W, linear.xyz_m - base[o.point]), o.point, o.n_points)
    xyz = base + np.einsum("nij,nj->ni", covariance, pull)
    difference = xyz[o.point] - linear.xyz_m
    WJ = W @ linear.jacobian
    share = covariance[o.point] @ WJ
    N, g = _normals(o, linear.jacobian, WJ, share, np.einsum("nij,nj->ni", W, difference))
    v = np.einsum("nij,nj->ni", T, difference)
    v[~held[o.point]] = np.nan
    xyz[~held], covariance[~held] = np.nan, np.nan
    return Eliminated(xyz, covariance, v, T, linear.jacobian, share, N, g)


def _summed(values: Float, point: Int, n_points: int) -> Float:
    flat = values.reshape(len(values), -1)
    sums = np.empty((n_points, flat.shape[1]))
    for k, column in enumerate(flat.T):
        sums[:, k] = np.bincount(point, column, n_points)
    return sums.reshape(n_points, *values.shape[1:])


def _normals(o: Observations, J: Float, WJ: Float, share: Float, weighted_v: Float) -> tuple[Float, Float]:
    u = J.shape[2]
    N, g = np.zeros((o.n_blocks, u, o.n_blocks, u)), np.zeros((o.n_blocks, u))
    for a, b, first, second in o.pairs:
        N[a, :, b] -= WJ[first].reshape(-1, u).T @ share[second].reshape(-1, u)
    for a in range(o.n_blocks):
        rows = np.flatnonzero(o.block == a)
        N[a, :, a] += J[rows].reshape(-1, u).T @ WJ[rows].reshape(-1, u)
        g[a] = J[rows].reshape(-1, u).T @ weighted_v[rows].ravel()
    flat = N.reshape(o.n_blocks * u, o.n_blocks * u)
    return 0.5 * (flat + flat.T), g.ravel()


def whitening(observations: Observations, covariance_m2: Float, tau_m: float) -> Float:
    """T with T'T = W, the weights; rows and columns of coordinates that are not given are zero.

    Exact control gets `EXACT` times the standard deviation of the strips' points.
    """
    o = observations
    strips = o.strip >= 0
    added = np.where(strips, tau_m**2, 0.0)
    variances = np.einsum("nii->n", covariance_m2[strips]) / 3 + tau_m**2
    model = float(np.median(variances)) if len(variances) else 0.0
    if model == 0.0:  # strips without any standard deviation: equal weights
        model = 1.0
        added[strips] = 1.0
    exact = ~strips[:, None] & (np.einsum("nii->ni", covariance_m2) < EXACT**2 * model)
    diagonal = added[:, None] + np.where(exact, EXACT**2 * model, 0.0)
    C = covariance_m2 + diagonal[:, :, None] * np.eye(3)
    # Not given: a unit variance without covariances, cut away again below.
    both = o.given[:, :, None] & o.given[:, None, :]
    T = np.linalg.inv(np.linalg.cholesky(np.where(both, C, np.eye(3))))
    return np.asarray(T * both)


def residual_cofactors(observations: Observations, system: Eliminated, Q: Float, use: Bool) -> Float:
    """Cofactors of the whitened residuals, T Qvv T'; for observations that are not active, of their prediction error.

    With Y_p = S^-1 W_p J_p, B_o Q B_o' = J_o Q J_o' - sum_p (J_o Q Y_p' + its transpose) + sum_(p,q) Y_p Q Y_q'.

    Returns
    -------
    (n, 3, 3) float64
    """
    o, J, Y = observations, system.jacobian, system.share
    u = J.shape[2]
    blocks = Q.reshape(o.n_blocks, u, o.n_blocks, u)
    own = np.zeros((len(o.strip), 3, 3))
    of_point = np.zeros((o.n_points, 3, 3))
    for a, b, first, second in o.pairs:
        QY = blocks[a, :, b] @ Y[second].swapaxes(1, 2)
        own_b = J[first] @ QY
        np.subtract.at(own, first, own_b + own_b.swapaxes(1, 2))
        np.add.at(of_point, o.point[first], Y[first] @ QY)
        if a == b:
            same = first[first == second]
            own[same] += J[same] @ blocks[a, :, a] @ J[same].swapaxes(1, 2)
    T = system.whitening
    spread = T @ (np.nan_to_num(system.point_covariance_m2)[o.point] + own + of_point[o.point]) @ T.swapaxes(1, 2)
    given = o.given[:, :, None] * np.eye(3)
    return np.asarray(np.where(use[:, None, None], given - spread, given + spread))
