"""Projection centres and points from the directions of rays, rotations known: v = d (X - c), d >= 0.

v is the unit direction of a ray turned to the ground, d the inverse of its length. For given c and X the best d is
max(0, v.w) / |X - c| with w = unit(X - c), and what remains of v is

    r = v - (v.w) w,    |r| = the sine of the angle between v and w,   1 behind the image

so that near and far points count alike and no scale is set too large by being small. d is eliminated; c and X are
adjusted with Huber's loss. A weak prior on the start keeps the seven free parameters of the block (four here) where
they are. From a random start rays look anywhere: then d is first held at one for all rays, where the problem is linear.

Source: Zhuang, Cheong & Lee, Baseline desensitizing in translation averaging (BATA), CVPR 2018; Pan, Barath, Pollefeys
& Schoenberger, Global structure-from-motion revisited (GLOMAP), ECCV 2024.
"""

import numpy as np

from aatri.adjustment.loss import Huber
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Float, Int
from aatri.geometry.vectors import tangents

CENTRE, POINT = "projection centre", "point"

LOSS = 2.0
"""Bound of Huber's loss, in standard deviations of a direction."""

PRIOR = 10.0
"""Standard deviation of the start, in extents of the block."""


def adjusted_directions(
    direction: Float, image: Int, point: Int, centre: Float, xyz: Float, sigma_rad: float, *, linear: bool = False
) -> tuple[Float, Float]:
    """Projection centres and points.

    Parameters
    ----------
    direction : (n, 3) float64
        Unit vectors of the rays, in one frame.
    image, point : (n,) int
    centre : (n_images, 3) float64
        Start.
    xyz : (n_points, 3) float64
        Start.
    sigma_rad : float
        Of a direction.
    linear : bool
        First with all rays of length one: from a start that is none.

    Raises
    ------
    ConvergenceError
        If the adjustment does not converge.
    """
    free = np.ones((len(xyz), 3), dtype=bool)
    unknowns = [
        Unknowns(
            CENTRE,
            np.ones((len(centre), 3), dtype=bool),
            ("X0", "Y0", "Z0"),
            _names(len(centre)),
            add_step,
            position=centre[:, :2],
        ),
        Unknowns(POINT, free, ("X", "Y", "Z"), _names(len(xyz)), add_step, eliminated=True),
    ]
    start: dict[str, Float] = {CENTRE: centre, POINT: xyz}
    if linear:
        start = dict(adjust_large(unknowns, [_of_length_one(direction, image, point), _prior(centre)], start).state)
    records = [_across(direction, image, point, sigma_rad), _prior(start[CENTRE])]
    adjusted = adjust_large(unknowns, records, start, max_iterations=100, tolerance=1e-2)
    return adjusted.state[CENTRE], adjusted.state[POINT]


def _names(n: int) -> tuple[str, ...]:
    return tuple(map(str, range(n)))


def _across(direction: Float, image: Int, point: Int, sigma_rad: float) -> Records:
    T = tangents(direction)

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        v, across = direction[rows], T[rows]
        w = state[POINT][point[rows]] - state[CENTRE][image[rows]]
        length = np.linalg.norm(w, axis=1)
        w = w / length[:, None]
        cosine = np.maximum(np.einsum("ni,ni->n", v, w), 0.0)
        offset = np.einsum("nij,ni->nj", across, w)
        r = np.concatenate([-cosine[:, None] * offset, 1.0 - cosine[:, None] ** 2], axis=1)
        by_w = (np.eye(3) - w[:, :, None] * w[:, None, :]) / length[:, None, None]
        of_cosine = np.where(cosine > 0, 1.0, 0.0)[:, None] * np.einsum("ni,nij->nj", v, by_w)
        J = np.empty((len(rows), 3, 3))
        J[:, :2] = -cosine[:, None, None] * np.einsum("nij,nik->njk", across, by_w)
        J[:, :2] -= offset[:, :, None] * of_cosine[:, None, :]
        J[:, 2] = -2.0 * cosine[:, None] * of_cosine
        return r, (-J, J)

    n = len(direction)
    touches = ((CENTRE, image), (POINT, point))
    return Records(
        "direction", touches, evaluate, np.full((n, 3), 1.0 / sigma_rad), np.ones(n, dtype=bool), loss=Huber(LOSS)
    )


def _of_length_one(direction: Float, image: Int, point: Int) -> Records:
    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        J = np.tile(np.eye(3), (len(rows), 1, 1))
        return state[POINT][point[rows]] - state[CENTRE][image[rows]] - direction[rows], (-J, J)

    n = len(direction)
    touches = ((CENTRE, image), (POINT, point))
    return Records("ray", touches, evaluate, np.ones((n, 3)), np.ones(n, dtype=bool), linear=True)


def _prior(centre: Float) -> Records:
    extent = float(np.abs(centre - centre.mean(axis=0)).max(initial=0.0)) or 1.0
    rows = np.arange(len(centre))

    def evaluate(state: State, chosen: Int) -> tuple[Float, tuple[Float, ...]]:
        return state[CENTRE][chosen] - centre[chosen], (np.tile(np.eye(3), (len(chosen), 1, 1)),)

    whitener = np.full((len(centre), 3), 1.0 / (PRIOR * extent))
    return Records("start", ((CENTRE, rows),), evaluate, whitener, np.ones(len(centre), dtype=bool), linear=True)
