"""Points of strips that go to the ground by one similarity each, or by functions in the strip's own axes.

    x_o = T_j + s_j R_j x,     dx_o = dT + [s R x]x' d + s R x m

with the seven unknowns of geometry.similarity per strip; x are coordinates in the strip, reduced to a centre of its
own. Covariances turn with the strip: s^2 R C R'.

By polynomials, or other functions:

    x_o = x + G_j (a_j'p, b_j'p, c_j'p),     dx_o / d(a, b, c) = G_j (x) p',     p = (1, U, V, U^2, U V)

x are the points brought to the ground approximately; x_o is linear in the coefficients a, b, c of dU, dV, dW
(`geometry.strip_bases`; the usual ones, second degree with 15 coefficients, have a compiled lane).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from aatri.adjustment.kernels.spectra import eigen, turn
from aatri.adjustment.records import Bind, Fill, Weigh
from aatri.adjustment.threads import in_threads, one_blas_thread
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Bool, Float, Int, Text
from aatri.errors import ConvergenceError
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import Similarity, motions
from aatri.geometry.strip_bases import SECOND_DEGREE, StripAxes, StripBasis, terms
from aatri.observations.poses import POINT
from aatri.observations.ties import BODY, Ties
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.kernels import ties as kernels

FARTHEST = 20.0
"""Step of the logarithm of a scale that no start calls for: a factor of 5e8."""

RUN_AWAY = "no scale fits, it runs away from its start: what is given of the ground contradicts itself or the strips"
CONTRADICTION = (
    "are X and Y of the control exchanged, its axes left-handed, or its units or zone others than those of the "
    "observed positions?"
)

LABELS = ("X", "Y", "Z", "rotation about X", "rotation about Y", "rotation about Z", "scale")


@dataclass(frozen=True)
class Similarities:
    """One similarity per strip: shift (n, 3), scale (n,) and rotation (n, 3, 3)."""

    translation: Float
    scale: Float
    rotation: Float

    def __getitem__(self, strip: int) -> Similarity:
        """That of one strip."""
        return Similarity(self.translation[strip], float(self.scale[strip]), self.rotation[strip])


def similarities_of(single: Sequence[Similarity]) -> Similarities:
    """Similarities side by side."""
    return Similarities(
        np.stack([s.translation for s in single]),
        np.array([s.scale for s in single]),
        np.stack([s.rotation for s in single]),
    )


def moved(value: Similarities, step: Float) -> Similarities:
    """After a step, (n, 7).

    Raises
    ------
    ConvergenceError
        If a scale runs away.
    """
    if (np.abs(step[:, 6]) > FARTHEST).any():
        raise ConvergenceError(RUN_AWAY, remedy=CONTRADICTION)
    return Similarities(
        value.translation + step[:, :3],
        value.scale * np.exp(step[:, 6]),
        exp_rotation(step[:, 3:6]) @ value.rotation,
    )


def similarity_ties(
    strip: Int,
    point: Int,
    x: Float,
    covariance: Float,
    *,
    names: Sequence[str] | Text,
    free: Bool | None = None,
    group: str = POINT,
) -> Ties[Similarities]:
    """Ties by similarities.

    Parameters
    ----------
    strip, point : (n,) int
    x : (n, 3) float64, unit of the strip
        Reduced to a centre of the strip.
    covariance : (n, 3, 3) float64, unit of the strip squared
    names : (n_strips,) sequence of str
    free : (n_strips,) bool, optional
        False for strips that are held.
    group : str
        Ground points, or images: of projection centres.
    """
    strip, point = strip.astype(np.int32), point.astype(np.int32)
    values, vectors = spectrum_of(covariance)

    def arms(state: Similarities, rows: Int) -> Float:
        """s R x."""
        k = strip[rows]
        turned: Float = np.einsum("nij,nj->ni", state.rotation[k], x[rows])
        return np.asarray(state.scale[k][:, None] * turned)

    def on_ground(state: Similarities, rows: Int) -> Float:
        return np.asarray(state.translation[strip[rows]] + arms(state, rows))

    def derivatives(state: Similarities, rows: Int) -> Float:
        return motions(arms(state, rows))

    def compiled(order: Int) -> Weigh:
        k, q, own = strip[order], point[order], np.ascontiguousarray(x[order])

        def weigh(T: Float) -> Bind:
            def bind(state: State) -> Fill:
                poses: Similarities = state[BODY]
                moved_by = (np.ascontiguousarray(poses.translation), np.ascontiguousarray(poses.scale))
                R, X = np.ascontiguousarray(poses.rotation), np.ascontiguousarray(state[POINT])
                arguments = (k, q, np.ascontiguousarray(T), X, own, *moved_by, R)
                return lambda first, last, v, J: kernels.similarity(first, last, *arguments, v, *J)

            return bind

        return weigh

    def spectrum(state: Similarities) -> tuple[Float, Float]:
        return turned_spectrum(strip, state, values, vectors)

    moving = np.ones(len(names), dtype=bool) if free is None else free
    unknowns = Unknowns(BODY, np.repeat(moving[:, None], 7, axis=1), LABELS, list(map(str, names)), moved)
    lane = compiled if group == POINT else None
    return Ties(strip, point, on_ground, derivatives, spectrum, unknowns, compiled=lane, group=group)


def turned_spectrum(body: Int, state: Similarities, values: Float, vectors: Float) -> tuple[Float, Float]:
    """Eigenvalues (n, 3) and eigenvectors (n, 3, 3) of covariances after the similarity of their body, (n,) int32."""
    turned = np.empty_like(values), np.empty_like(vectors)
    pose = np.ascontiguousarray(state.scale), np.ascontiguousarray(state.rotation)
    in_threads(len(body), lambda first, last: turn(first, last, body, *pose, values, vectors, *turned))
    return turned


def spectrum_of(covariance: Float) -> tuple[Float, Float]:
    """Eigenvalues (n, 3), none negative, and eigenvectors by columns (n, 3, 3) of covariances (n, 3, 3)."""
    values, vectors = np.empty(covariance.shape[:2]), np.empty(covariance.shape)
    eigen(0, len(values), np.require(covariance, np.float64, ["C", "W"]), values, vectors)
    return np.maximum(values, 0.0), vectors


def polynomial_ties(
    points: BodyPoints,
    axes: Sequence[StripAxes],
    *,
    names: Sequence[str] | Text,
    free: Bool,
    basis: StripBasis = SECOND_DEGREE,
) -> Ties[Float]:
    """Ties by polynomials; the state is the coefficients, (n_strips, K).

    Parameters
    ----------
    points : BodyPoints
        On the ground; unit m.
    axes : (n_strips,) sequence of StripAxes
    names : (n_strips,) sequence of str
    free : (n_strips, K) bool
        Coefficients that are estimated.
    """
    strip, point = points.strip.astype(np.int32), points.point.astype(np.int32)
    G = np.ascontiguousarray(np.stack([a.ground_from_axes for a in axes]))
    p = terms_of_points(points, axes)
    usual = basis.labels == SECOND_DEGREE.labels

    def design(rows: Int) -> Float:
        return np.asarray(G[strip[rows]] @ design_of_points(points.take(rows), axes, basis))

    @cache
    def D() -> Float:
        return design(np.arange(len(strip)))

    def on_ground(state: Float, rows: Int) -> Float:
        if not usual:
            return np.asarray(points.xyz[rows] + np.einsum("nij,nj->ni", D()[rows], state[strip[rows]]))
        # G a, G b, G c of every strip first: a row takes fifteen products then.
        turned = np.einsum("kij,kjt->kit", G, state.reshape(len(G), 3, 5))
        return np.asarray(points.xyz[rows] + np.einsum("nit,nt->ni", turned[strip[rows]], p[rows]))

    def derivatives(_state: Float, rows: Int) -> Float:
        return design(rows) if usual else np.asarray(D()[rows])  # of all rows they are the largest array

    def compiled(order: Int) -> Weigh:
        k, q, terms = strip[order], point[order], np.ascontiguousarray(p[order])
        x = np.ascontiguousarray(points.xyz[order])

        def weigh(T: Float) -> Bind:
            def bind(state: State) -> Fill:
                X, coefficients = np.ascontiguousarray(state[POINT]), np.ascontiguousarray(state[BODY])
                arguments = (k, q, np.ascontiguousarray(T), X, x, terms, G, coefficients)
                return lambda first, last, v, J: kernels.polynomial(first, last, *arguments, v, *J)

            return bind

        return weigh

    @cache
    def eigen() -> tuple[Float, Float]:
        return spectrum_of(points.covariance)

    def spectrum(_state: Float) -> tuple[Float, Float]:
        return eigen()

    unknowns = Unknowns(BODY, free, basis.labels, list(map(str, names)), add_step)
    return Ties(strip, point, on_ground, derivatives, spectrum, unknowns, True, compiled if usual else None)


def terms_of_points(points: BodyPoints, axes: Sequence[StripAxes]) -> Float:
    """The terms 1, U, V, UU, UV of every strip point, (n, 5)."""
    local, _ = in_axes(points, axes)
    return terms(local[:, 0], local[:, 1], full=False, degree=2)


def design_of_points(points: BodyPoints, axes: Sequence[StripAxes], basis: StripBasis) -> Float:
    """Derivatives of the deformations of every strip point, in its strip's axes, by the coefficients, (n, 3, K)."""
    local, half = in_axes(points, axes)
    return basis.rows(local[:, 0], local[:, 1], half[:, 1] / half[:, 0])


def products_of_points(points: BodyPoints, axes: Sequence[StripAxes], basis: StripBasis) -> tuple[Float, Int]:
    """D'D of the design D of each strip's points, (n_strips, K, K), and how many points it has."""
    order, count = np.argsort(points.strip, kind="stable"), np.bincount(points.strip, minlength=len(axes))
    products = np.zeros((len(axes), basis.size, basis.size))
    with one_blas_thread():  # the last bits depend on how many there are
        for k, rows in enumerate(np.split(order, np.cumsum(count)[:-1])):  # of all together D is the largest array
            D = design_of_points(points.take(rows), axes, basis).reshape(-1, basis.size)
            products[k] = D.T @ D
    return products, count


def in_axes(points: BodyPoints, axes: Sequence[StripAxes]) -> tuple[Float, Float]:
    """u and v of every strip point, (n, 2), and the half ranges of its strip, (n, 2), m."""
    origin, half = np.stack([a.origin_m for a in axes]), np.stack([a.half_range_m for a in axes])
    G, strip = np.stack([a.ground_from_axes for a in axes]), points.strip
    local = np.einsum("nji,nj->ni", G[strip], points.xyz - origin[strip])[:, :2] / half[strip]
    return local, half[strip]
