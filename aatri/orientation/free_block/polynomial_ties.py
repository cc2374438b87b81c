"""Points of strips that go to the ground by polynomials in the strip's own axes.

    x_o = x + G_j (a_j'p, b_j'p, c_j'p),     dx_o / d(a, b, c) = G_j (x) p',     p = (1, U, V, U^2, U V)

x are the points brought to the ground approximately; x_o is linear in the 15 coefficients a, b, c of dU, dV, dW.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from aatri.adjustment.records import Bind, Fill, Weigh
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Bool, Float, Int, Text
from aatri.geometry.polynomials import TERMS, StripAxes, polynomial_rows
from aatri.orientation.free_block.component_growth import StripPoints
from aatri.orientation.free_block.kernels import ties as kernels
from aatri.orientation.free_block.tie_records import POINT, STRIP, Ties

COEFFICIENTS = 15
LABELS = tuple(f"{axis}_{term}" for axis in "abc" for term in TERMS)


def polynomial_ties(
    points: StripPoints, axes: Sequence[StripAxes], *, names: Sequence[str] | Text, n_points: int, free: Bool
) -> Ties[Float]:
    """Ties by polynomials; the state is the coefficients, (n_strips, 15).

    Parameters
    ----------
    points : StripPoints
        On the ground; unit m.
    axes : (n_strips,) sequence of StripAxes
    names : (n_strips,) sequence of str
    n_points : int
    free : (n_strips, 15) bool
        Coefficients that are estimated.
    """
    strip, point = points.strip.astype(np.int32), points.point.astype(np.int32)
    p, G = terms_of_points(points, axes), np.ascontiguousarray(np.stack([a.ground_from_axes for a in axes]))

    def on_ground(state: Float, rows: Int) -> Float:
        k = strip[rows]
        along = np.einsum("njt,nt->nj", state[k].reshape(-1, 3, 5), p[rows])
        return np.asarray(points.xyz[rows] + np.einsum("nij,nj->ni", G[k], along))

    def derivatives(_state: Float, rows: Int) -> Float:
        J = G[strip[rows]][:, :, :, None] * p[rows][:, None, None, :]
        return J.reshape(len(rows), 3, COEFFICIENTS)

    def compiled(order: Int, base_m: Float) -> Weigh:
        k, q, terms = strip[order], point[order], np.ascontiguousarray(p[order])
        x = np.ascontiguousarray(points.xyz[order] - base_m)

        def weigh(T: Float) -> Bind:
            def bind(state: State) -> Fill:
                X, coefficients = np.ascontiguousarray(state[POINT]), np.ascontiguousarray(state[STRIP])
                given = (k, q, np.ascontiguousarray(T), X, x, terms, G, coefficients)
                return lambda first, last, v, J: kernels.polynomial(first, last, *given, v, *J)

            return bind

        return weigh

    @cache
    def eigen() -> tuple[Float, Float]:
        values, vectors = np.linalg.eigh(points.covariance)
        return np.maximum(values, 0.0), vectors

    def spectrum(_state: Float) -> tuple[Float, Float]:
        return eigen()

    unknowns = Unknowns(STRIP, free, LABELS, list(map(str, names)), add_step)
    return Ties(strip, point, on_ground, derivatives, spectrum, unknowns, n_points, None, compiled)


def terms_of_points(points: StripPoints, axes: Sequence[StripAxes]) -> Float:
    """The terms 1, U, V, UU, UV of every strip point, (n, 5)."""
    origin, half = np.stack([a.origin_m for a in axes]), np.stack([a.half_range_m for a in axes])
    G, strip = np.stack([a.ground_from_axes for a in axes]), points.strip
    local = np.einsum("nji,nj->ni", G[strip], points.xyz - origin[strip])[:, :2] / half[strip]
    return polynomial_rows(local[:, 0], local[:, 1])
