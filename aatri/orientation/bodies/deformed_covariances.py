"""Covariances of adjusted strips whose points share a deformation, which no white standard deviation reproduces.

The strips were adjusted with white weights W = (C_o + tau^2 I)^-1; that stays as it is. Their points err by e + F z: e
white, covariance phi W^-1, F z the summed deformation (summed_deformation). The coefficients c take up a part of it,

    c errs by  -A z + noise,      A = N_cc^-1 N_cz,      noise: phi N_cc^-1, with control by its own standard deviations

N of deformed_normals; the rest, F z - D A z, remains in the points. Where a strip keeps its similarity F z is what that
has left of the deformation, F z + S s (taken_up). Ground points are weighted means over the strips:

    C_X = B C_(c, z) B' + phi (sum W)^-1,      B = (sum W)^-1 W (D, F)

The variances theta of z and phi are estimated from the residuals (deformation_components), phi no smaller than the
standard deviations a priori want it. A component of the joints that has, with what stands beside it, a redundancy below
`ESTIMABLE_REDUNDANCY` is not estimable, and then no covariance is given.

Source: collocation with the filter of another adjustment: Moritz 1980, Advanced Physical Geodesy.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_solve, solve_triangular
from scipy.sparse import csr_array

from aatri.adjusting.added_variance import tie_whitener, typical_variance, whitener_beside
from aatri.adjusting.tied_adjustment import TiedResult
from aatri.adjustment.statistics.limits import ESTIMABLE_REDUNDANCY
from aatri.adjustment.threads import one_blas_thread
from aatri.arrays import Float, Int, sums_of
from aatri.geometry.strip_bases import StripAxes
from aatri.notes import Note
from aatri.observations.control import Control
from aatri.observations.observed import Spread
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.deformation_components import DeformationComponents, deformation_components
from aatri.orientation.bodies.deformed_normals import (
    DeformedTies,
    by_functions,
    deformed_ties,
    is_wide,
    misfit,
    normals,
    of_control,
    pairs_of_strips,
)
from aatri.orientation.bodies.determined_degrees import kept_coefficients
from aatri.orientation.bodies.strip_polynomials import StripPolynomials
from aatri.orientation.bodies.summed_deformation import BESIDE, COMPONENT, HIGHEST, TOGETHER
from aatri.orientation.bodies.taken_up import SIZE, similarities, taken_up

MOST_STRIPS = 200
"""Deformations of all strips hang together: their matrices grow with the square of the strips, to 1 GB at 500."""

ABSORBED = 1e-6
"""Share of a deformation's information that is left where both adjustments take it up: rounding leaves 1e-11 to 1e-7,
what is not taken up has 1e-3 and more."""


@dataclass(frozen=True)
class DeformedCovariances:
    """What the points and coefficients of adjusted strips are worth."""

    point_covariance_m2: Float
    """(n_points, 3, 3), m^2. NaN where not determined; all of it where a component is not estimable."""
    coefficient_sigma_m: Float
    """(n_strips, K), m. The same."""
    sigma: dict[str, float]
    redundancy: dict[str, float]
    """Standard deviations of the components, rad, and their redundancies."""
    missing: str = ""
    """Why there are none."""


@dataclass(frozen=True)
class _Normals:
    """Normal equations of coefficients c, similarities s and deformations z of all strips, of unit variance each."""

    ties: DeformedTies
    basis: Float
    """(n_strips, functions, columns). The functions of c, s and z of each strip."""
    weights: Float
    """(n_points, 3, 3). Sums over the strips, without control."""
    inverse: Float
    """(n_points, 3, 3). Of the sums with control."""
    control_whitener: Float
    N: csr_array
    c: Int
    s: Int
    z: Int
    """Rows of each in N."""
    taken_up: Float
    """(n_s, n_z). By what the similarities err for deformations of one; no row where the coefficients hold them."""


@dataclass(frozen=True)
class _ReducedNormals:
    """The normal equations of the deformations that are left, without coefficients and similarities."""

    z: Int
    strip: Int
    cause: Int
    """(n,). Rows of the deformations in N, the strip of each, and what deforms it."""
    taken_up: Float
    """Of these deformations."""
    A: Float
    """By what the coefficients err for deformations of one, changed in sign."""
    Q: Float
    """Inverse of the normal matrix of the coefficients."""


@one_blas_thread()  # matrices of some hundred rows
def deformed_covariances(
    result: StripPolynomials,
    points: BodyPoints,
    n_points: int,
    axes: Sequence[StripAxes],
    control: Control,
    models: Int,
) -> DeformedCovariances:
    """Covariances of points and coefficients of adjusted strips.

    Parameters
    ----------
    axes : (n_strips,) sequence of StripAxes
    models : (n_strips,) int
        Of each strip.
    """
    tied, n_strips = result.tied, len(axes)
    kept = kept_coefficients(result.degree, result.basis)
    spread = tied.problem.spread(tied.state)
    none = DeformedCovariances(np.full((n_points, 3, 3), np.nan), np.full(kept.shape, np.nan), {}, {})
    if tied.redundancy <= 0 or not spread.values.any():
        return replace(none, missing="the deformation of the strips is not estimable (no redundancy)")
    if n_strips > MOST_STRIPS:
        return replace(none, missing=f"{n_strips} strips, more than {MOST_STRIPS}")
    normal = _normals(result, spread, points, n_points, axes, control, models)
    reduced = _reduced(normal, n_strips)
    estimated, component, names, few = _estimated(normal, reduced, tied, spread, axes)
    present = np.unique(component).tolist()
    sigma = {names[k]: float(np.sqrt(estimated.variance[k])) for k in present}
    redundancy = {names[k]: float(estimated.redundancy[k]) for k in present}
    if few or not present:
        reason = f"redundancy below {ESTIMABLE_REDUNDANCY:g}: " + ", ".join(few) if few else "no redundancy"
        missing = f"the deformation of the strips is not estimable ({reason})"
        return replace(none, sigma=sigma, redundancy=redundancy, missing=missing)
    theta = estimated.variance[component] * estimated.size[reduced.strip]
    C = _of_parameters(normal, reduced, theta, estimated.phi, control.point)
    sigmas = np.sqrt(np.maximum(C.diagonal(), 0.0)).reshape(n_strips, -1)[:, : kept.shape[1]]
    of_points = _of_points(normal.ties, C, normal.basis, normal.weights, estimated.phi)
    return DeformedCovariances(of_points, np.where(kept, sigmas, np.nan), sigma, redundancy)


def _normals(
    result: StripPolynomials,
    spread: Spread,
    points: BodyPoints,
    n_points: int,
    axes: Sequence[StripAxes],
    control: Control,
    models: Int,
) -> _Normals:
    """The weights of the adjustment, and its normal equations with all that strips are deformed by."""
    tied, n_strips = result.tied, len(axes)
    active, T_ties = tied.active[: len(points.strip)], tie_whitener(spread, tied.tau_m)
    ties = deformed_ties(points, axes, active, T_ties, wide=is_wide(result.basis))
    typical = typical_variance(spread, tied.tau_m)
    beside = [whitener_beside(o, C, typical) for o, C in zip(tied.problem.ground, tied.problem.covariances)]
    T = np.concatenate([np.zeros((0, 3, 3)), *beside]) * tied.active[len(points.strip) :, None, None]
    total = _sums(T_ties[active], points.point[active], n_points)
    inverse = _inverses(total + _sums(T, control.point, n_points))
    shared = np.bincount(ties.point, minlength=n_points) > 1
    controlled = np.bincount(control.point, minlength=n_points) > 0
    kept = kept_coefficients(result.degree, result.basis)
    K = kept.shape[1]
    width = SIZE if int(result.degree.min()) < 1 else 0  # columns of similarities: coefficients of degree 1 hold them
    latent, moved = by_functions(axes, models, result.basis), similarities(axes, ties.f.shape[1], HIGHEST + 1)
    basis = np.concatenate([latent[:, :, :K], moved[:, :, :width], latent[:, :, K:]], axis=2)
    N_ties = normals(ties, basis, inverse, shared & ~controlled)
    N = N_ties + normals(ties, basis, inverse, controlled)
    place = np.tile(np.arange(basis.shape[2]), n_strips)
    c = np.flatnonzero(np.pad(kept, ((0, 0), (0, basis.shape[2] - K))).ravel())
    s, z = np.flatnonzero((place >= K) & (place < K + width)), np.flatnonzero(place >= K + width)
    error = np.zeros((len(s), len(z)))
    if width:
        N_ties = N_ties + normals(ties, basis, _inverses(total), shared & controlled)
        to_ground = N if T.any() else normals(ties, basis, 0.0 * inverse, np.ones(n_points, dtype=bool))
        error = taken_up(N_ties, to_ground, s, z, axes)
    return _Normals(ties, basis, total, inverse, T, N, c, s, z, error)


def _reduced(normal: _Normals, n_strips: int) -> _ReducedNormals:
    """Coefficients and similarities eliminated; without the deformations that these take up whole."""
    N, c, s, z, error = normal.N, normal.c, normal.s, normal.z, normal.taken_up
    L = np.linalg.cholesky(N[c][:, c].toarray())
    brought = N[:, z].toarray() + N[:, s] @ error
    half = solve_triangular(L, brought[c], lower=True)
    A, Q = solve_triangular(L, half, lower=True, trans="T"), cho_solve((L, True), np.eye(len(c)))
    information = brought[z, np.arange(len(z))] + (error * brought[s]).sum(axis=0) - (half**2).sum(axis=0)
    left = information > ABSORBED * np.maximum(N.diagonal()[z], 1e-300)  # neither adjustment took it up whole
    strip, cause = np.repeat(np.arange(n_strips), len(COMPONENT))[left], np.tile(COMPONENT, n_strips)[left]
    return _ReducedNormals(z[left], strip, cause, error[:, left], A[:, left], Q)


def _estimated(
    normal: _Normals, reduced: _ReducedNormals, tied: TiedResult, spread: Spread, axes: Sequence[StripAxes]
) -> tuple[DeformationComponents, Int, tuple[str, ...], list[str]]:
    """Variances of the deformations, as many components as the block tells apart; which of these each has, their names,
    and those that are not estimable, with their redundancies.
    """
    of_misfit = misfit(normal.ties, tied.residuals, len(normal.basis))
    of_misfit = np.einsum("sfk,sf->sk", normal.basis, of_misfit).ravel()
    rows = np.sort(np.concatenate([normal.c, normal.s, reduced.z]))
    is_z, strip = np.isin(rows, reduced.z), rows // normal.basis.shape[2]
    N, g = normal.N[rows][:, rows], of_misfit[rows]
    origin_m = np.stack([a.origin_m[:2] for a in axes])
    squares, redundancy = tied.weighted_sigma0**2 * tied.redundancy, tied.redundancy + len(normal.c)
    least = float(spread.values.mean() / (spread.values.mean() + tied.tau_m**2))
    for names, together in TOGETHER:
        component, lasting = together[reduced.cause], together[BESIDE]
        of_rows = np.full(len(rows), -1)
        of_rows[is_z] = component
        estimated = deformation_components(N, g, of_rows, strip, squares, redundancy, least, origin_m)
        present = np.unique(component).tolist()
        r = np.bincount(lasting[present], estimated.redundancy[present])
        few = [f"{names[k]} ({r[k]:.1f})" for k in np.unique(lasting[present]).tolist() if r[k] < ESTIMABLE_REDUNDANCY]
        if not few:
            break
    return estimated, component, names, few


def _of_parameters(normal: _Normals, reduced: _ReducedNormals, theta: Float, phi: float, control: Int) -> Float:
    """Covariances of coefficients, similarities and deformations together, (columns of all strips, square).

    Parameters
    ----------
    theta : (n_z,) float64
        Variances of the deformations.
    phi : float
        Variance of unit weight.
    control : (n,) int
        Points of the control.
    """
    N, c, s, z = normal.N, normal.c, normal.s, reduced.z
    on_control = of_control(normal.ties, len(normal.basis), normal.inverse, control, normal.control_whitener)
    by_control = normal.basis.swapaxes(1, 2) @ on_control
    noise = reduced.Q @ by_control.reshape(N.shape[0], 3 * len(control))[c]
    C = np.zeros(N.shape)
    r, R = np.concatenate([c, s]), np.concatenate([-reduced.A, reduced.taken_up])
    root = R * np.sqrt(theta)
    C[np.ix_(r, r)], C[np.ix_(r, z)], C[np.ix_(z, r)] = root @ root.T, R * theta, (R * theta).T
    C[z, z] = theta
    C[np.ix_(c, c)] += phi * reduced.Q + (1 - phi) * noise @ noise.T
    return C


def covariance_notes(covariances: DeformedCovariances) -> list[Note]:
    """How far the joints of the strips err, or why there are no standard deviations."""
    if covariances.missing:
        return [Note("note", f"no standard deviations of points and coefficients: {covariances.missing}")]
    sigmas = ", ".join(f"{name} {1e6 * sigma:.3g} urad" for name, sigma in covariances.sigma.items())
    return [
        Note("note", f"summed deformation, counted in the standard deviations of points and coefficients: {sigmas}")
    ]


def _sums(whitener: Float, point: Int, n_points: int) -> Float:
    """Sums of the weights of every point, (n_points, 3, 3)."""
    return sums_of(whitener.swapaxes(1, 2) @ whitener, point, n_points)


def _inverses(weights: Float) -> Float:
    """Inverses of the weights of points; 1 where a coordinate has none, as height control whose ties are rejected."""
    full = weights.copy()
    diagonal = np.einsum("nii->ni", full)  # a view
    diagonal[diagonal == 0.0] = 1.0
    return np.asarray(np.linalg.inv(full))


def _of_points(ties: DeformedTies, C: Float, latent_basis: Float, weights: Float, phi: float) -> Float:
    """Covariances of the weighted means over the strips; NaN where no strip holds the point."""
    n, functions, size = latent_basis.shape
    blocks = C.reshape(n, size, n, size).swapaxes(1, 2)
    m = functions // 3
    inverse = _inverses(weights)
    B, covariance = inverse[ties.point] @ ties.weight, phi * inverse
    for j, k, first, second in pairs_of_strips(ties.strip, ties.point):
        # Of the functions: for each pair of axes f_j' C f_k.
        in_words = (
            (latent_basis[j] @ blocks[j, k] @ latent_basis[k].T)
            .reshape(3, m, 3, m)
            .transpose(1, 0, 2, 3)
            .reshape(m, 9 * m)
        )
        spread = ((ties.f[first] @ in_words).reshape(-1, 9, m) @ ties.f[second][:, :, None]).reshape(-1, 3, 3)
        of_pair = B[first] @ spread @ B[second].swapaxes(1, 2)
        covariance[ties.point[first]] += of_pair if j == k else of_pair + of_pair.swapaxes(1, 2)
    covariance[~weights.any(axis=(1, 2))] = np.nan
    return covariance
