"""How errors of the joints deform a strip: a random walk of its attitude and scale, and what that sums up to.

At each of the n joints of a strip attitude and scale err by a little more, independently, with a standard deviation
sigma (rad; for the scale a share of itself). Along the strip they are random walks; places are sums of those:

    along the strip    dU, dV, dW:  h(t), integrated random walk, variance sigma^2 b^2 n^3 per unit of time t in [0, 1]
    across             v dU, v dV, v dW:  w(t), random walk, variance sigma^2 r^2 n per unit of time

b is the length of a model, r half the strip's width. On u in [-1, 1] along the strip they are developed in Legendre
polynomials, h of degree 2 to `HIGHEST`, w of degree 1 to `HIGHEST` - 1. With w dt = dB for the increments,

    c_a = (2a + 1) / 2 int P_a w du = (2a + 1) / 2 int J_a dB,     J_a(s) = int_s^1 P_a,     for h once more,

so that the covariances of the coefficients are integrals of products of polynomials, exact. Higher degrees have
variances that fall with the fourth (h) and the second (w) power of the degree. Lower ones a similarity takes away
(taken_up).

Source: Vermeir 1954; Ackermann 1965 (errors of joints add up twice); aatri/orientation/bodies/deformation.py.
"""

from functools import cache

import numpy as np
from numpy.polynomial import legendre

from aatri.arrays import Float, Int

HIGHEST = 6
"""Highest degree along the strip. What is left out looks like joints that err more: with 4 the standard deviations of
dense blocks were a fifth too large."""

SCALE, AZIMUTH, PITCH, ROLL = range(4)
"""Variance components: of the joints' scale, azimuth and two tilts, which relative orientation determines differently
well."""

COMPONENTS = ("joints, scale", "joints, azimuth", "joints, tilt along", "joints, tilt across")

TOGETHER = (SCALE, SCALE, PITCH, PITCH)
"""Plan and height alone, where a block tells not more."""

COMPONENTS_TOGETHER = ("joints, in plan", "", "joints, in height", "")

_COUNT = HIGHEST - 1
AXIS: Int = np.repeat([0, 1, 2, 0, 1, 2], _COUNT)
"""Direction of every cause, U, V or W: h, then w."""

_OF_AXES = np.array([[SCALE, AZIMUTH, PITCH], [AZIMUTH, SCALE, ROLL]])
COMPONENT: Int = _OF_AXES[np.repeat(range(2), 3 * _COUNT), AXIS]


def functions(u: Float, v: Float, *, wide: bool) -> Float:
    """Functions of which all deformations are made: P_0 to P_6 of u, v times P_0 to P_5; wide: v^2, u v^2, v^3 too.

    Parameters
    ----------
    u, v : (n,) float64
        In the axes of the strip, -1 to 1.
    wide : bool

    Returns
    -------
    (n, m) float64
    """
    P = legendre.legvander(u, HIGHEST)
    across = (v[:, None] ** 2, (u * v * v)[:, None], v[:, None] ** 3) if wide else ()
    return np.concatenate([P, v[:, None] * P[:, :HIGHEST], *across], axis=1)


def causes(half_range_m: Float, models: Int, count: int) -> Float:
    """Deformations by independent causes, each of a variance component of one.

    Parameters
    ----------
    half_range_m : (n_strips, 2) float64, m
        Of the strips, along and across.
    models : (n_strips,) int
        Of the strips.
    count : int
        Of the functions, m.

    Returns
    -------
    (n_strips, 3, m, L) float64, m
        By the functions in U, V and W.
    """
    found = np.zeros((len(models), 3, count, len(AXIS)))
    sums, walks = _roots()
    first = HIGHEST + 1
    for axis in range(3):
        h, w = np.flatnonzero(axis == AXIS).reshape(2, _COUNT)
        root = np.sqrt(models)[:, None, None]
        found[:, axis, 2:first, h] = (2 * half_range_m[:, :1, None] * root * sums).transpose(2, 0, 1)
        found[:, axis, first + 1 : first + HIGHEST, w] = (half_range_m[:, 1:, None] * root * walks).transpose(2, 0, 1)
    return found


@cache
def _roots() -> tuple[Float, Float]:
    """Roots of the covariances of the coefficients of h, degree 2 and above, and of w, degree 1 and above."""
    sums, walks = covariances(tuple(range(2, HIGHEST + 1)), 2), covariances(tuple(range(1, HIGHEST)), 1)
    return np.asarray(np.linalg.cholesky(sums)), np.asarray(np.linalg.cholesky(walks))


def covariances(degrees: tuple[int, ...], sums: int) -> Float:
    """Covariances of Legendre coefficients of white noise summed once or twice over a time of one.

    Parameters
    ----------
    degrees : tuple of int
        Not below `sums`.
    sums : {1, 2}

    Returns
    -------
    (k, k) float64
    """
    size = max(degrees) + sums + 1
    weight = np.zeros((len(degrees), size))
    for row, a in zip(weight, degrees):
        # Time is half of u: each sum but the first brings a factor 1/2.
        series = (2 * a + 1) / 2**sums * legendre.legint(np.eye(a + 1)[a], m=sums, lbnd=1)
        row[: len(series)] = series
    return np.asarray((weight / (2 * np.arange(size) + 1)) @ weight.T)
