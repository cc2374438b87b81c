"""How errors of the joints deform a strip: walks of its attitude and scale, and what they sum up to.

At each of the n joints of a strip its scale, azimuth and two tilts err by a little more, independently, each with a
standard deviation sigma of its own (rad; for the scale a share of itself). Along the strip they are random walks w(t),
t in [0, 1], of the variance sigma^2 n; places are sums of them. At U along the strip, V beside the cameras and H below
them:

    scale          dU = sum w,   dV = V w,   dW = -H w
    azimuth        dV = sum w,   dU = -V w
    tilt along     dW = sum w
    tilt across    dW = V w

Not all errors last. What an image errs by alone is in the two joints beside it with opposite signs and does not add up;
the direction of a base moves what follows across, but does not turn it. They have variances of their own:

    bases in plan         dV: summed once, as the azimuth's summed twice
    tilt across, images   dW = V w, w white

With 80 % overlap, where neighbouring models have most of their points in common, they are the larger part. On u in
[-1, 1] along the strip all are developed in Legendre polynomials, sums of degree 2 to `HIGHEST`, walks of degree 1 to
`HIGHEST` - 1. With w dt = dB for the increments,

    c_a = (2a + 1) / 2 int P_a w du = (2a + 1) / 2 int J_a dB,     J_a(s) = int_s^1 P_a,     for sums once more,

so that the covariances of the coefficients are integrals of products of polynomials, exact. Higher degrees have
variances that fall with the fourth (sums) and the second (walks) power of the degree. Lower ones a similarity takes
away (taken_up).

Source: Vermeir 1954; Ackermann 1965 (errors of joints add up twice); aatri/orientation/bodies/deformation.py.
"""

from functools import cache

import numpy as np
from numpy.polynomial import legendre

from aatri.arrays import Float, Int

HIGHEST = 6
"""Highest degree along the strip. What is left out looks like joints that err more: with 4 the standard deviations of
dense blocks were a fifth too large."""

SCALE, AZIMUTH, PITCH, ROLL, BASES, IMAGES = range(6)
"""Variance components: of the joints' scale, azimuth and two tilts, which relative orientation determines differently
well; of the bases in plan, and of the tilt across of single images."""

COMPONENTS = (
    "joints, scale",
    "joints, azimuth",
    "joints, tilt along",
    "joints, tilt across",
    "bases, azimuth",
    "images, tilt across",
)

BESIDE: Int = np.array([SCALE, AZIMUTH, PITCH, ROLL, AZIMUTH, ROLL])
"""The component of the joints beside which each stands: what matters is that data tell enough of both together."""

TOGETHER: tuple[tuple[tuple[str, ...], Int], ...] = (
    (COMPONENTS, np.arange(len(COMPONENTS))),
    (
        ("joints, in plan", "", "joints, in height", "", *COMPONENTS[BASES:]),
        np.array([SCALE, SCALE, PITCH, PITCH, BASES, IMAGES]),
    ),
    (("joints", "", "", "", *COMPONENTS[BASES:]), np.array([SCALE, SCALE, SCALE, SCALE, BASES, IMAGES])),
)
"""Names, and which components are one: all apart; joints in plan and height alone, and all joints together, where a
block tells not more."""

_N = HIGHEST - 1
_WALK = HIGHEST + 1
"""Coefficients of the walks of scale and azimuth, whose sums have degrees up to `HIGHEST`."""

COMPONENT: Int = np.repeat(range(6), [_WALK, _WALK, _N, _N, _N, _N])
"""Of every cause."""


def functions(u: Float, v: Float, *, wide: bool) -> Float:
    """Functions of which all deformations are made: P_0 to P_6 of u, v times P_0 to P_5; wide: v^2, u v^2, v^3 too.

    Parameters
    ----------
    u, v : (n,) float64
        In the axes of the strip, -1 to 1.

    Returns
    -------
    (n, m) float64
    """
    P = legendre.legvander(u, HIGHEST)
    across = (v[:, None] ** 2, (u * v * v)[:, None], v[:, None] ** 3) if wide else ()
    return np.concatenate([P, v[:, None] * P[:, :HIGHEST], *across], axis=1)


def causes(half_range_m: Float, camera_m: Float, models: Int, count: int) -> Float:
    """Deformations by independent causes, each of a variance component of one.

    Parameters
    ----------
    half_range_m : (n_strips, 2) float64, m
        Of the strips, along and across.
    camera_m : (n_strips, 2) float64, m
        Middle of the projection centres from that of the points, across and up.
    models : (n_strips,) int
        Of the strips.
    count : int
        Of the functions, m.

    Returns
    -------
    (n_strips, 3, m, L) float64, m
        By the functions in U, V and W.
    """
    variances = np.zeros((len(models), 3, count, len(COMPONENT)))
    members = [np.flatnonzero(component == COMPONENT) for component in range(len(COMPONENTS))]
    lasting, summed, single, white = _roots()
    along, across = np.sqrt(models) * half_range_m.T * [[2], [1]]
    lateral, height = np.sqrt(models) * camera_m.T
    # Functions: P_2 and above; v P_1 and above; P_1 and above.
    sums, walks, flat = np.arange(2, HIGHEST + 1), np.arange(_N) + HIGHEST + 2, np.arange(1, HIGHEST + 1)
    # The integral of P_a is the difference of its neighbours over 2 a + 1.
    k, a = sums[:, None], np.arange(1, _WALK + 1)
    of_walk = ((k == a + 1) / (2 * k - 1) - (k == a - 1) / (2 * k + 3)) / 2 @ lasting
    for component, axis, size, root in (
        (SCALE, 0, along, of_walk),
        (AZIMUTH, 1, along, of_walk),
        (PITCH, 2, along, summed),
        (BASES, 1, along / models, single),
    ):
        variances[:, axis, k, members[component]] = size[:, None, None] * root
    for component, axis, share, root in (
        (SCALE, 1, models**0, lasting),
        (AZIMUTH, 0, -(models**0), lasting),
        (ROLL, 2, models**0, lasting[:_N, :_N]),
        (IMAGES, 2, 1 / models, white),
    ):
        rows = flat[: len(root)]  # a lever of V less that of the cameras
        variances[:, axis, walks[:, None], members[component]] = (share * across)[:, None, None] * root[:_N]
        variances[:, axis, rows[:, None], members[component]] = -(share * lateral)[:, None, None] * root[:HIGHEST]
    variances[:, 2, flat[:, None], members[SCALE]] = -height[:, None, None] * lasting[:HIGHEST]
    return variances


@cache
def _roots() -> tuple[Float, Float, Float, Float]:
    """Roots of covariances: of a walk, degree 1 and above; of white noise summed twice and once, degree 2 and above; of
    white noise, degree 1 and above."""
    h, w = tuple(range(2, HIGHEST + 1)), tuple(range(1, HIGHEST))
    laws = covariances(tuple(range(1, _WALK + 1)), 1), covariances(h, 2), covariances(h, 1), covariances(w, 0)
    walk, summed, single, white = (np.asarray(np.linalg.cholesky(law)) for law in laws)
    return walk, summed, single, white


def covariances(degrees: tuple[int, ...], sums: int) -> Float:
    """Covariances of Legendre coefficients of white noise, as it is or summed once or twice, over a time of one.

    Parameters
    ----------
    degrees : tuple of int
        Not below `sums`.
    sums : {0, 1, 2}

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
