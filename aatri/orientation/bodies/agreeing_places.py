"""Places that one similarity fits while all others are far off: a start where up to half of the control is wrong.

Three places known in full determine a similarity. That of three counts on which most others agree: they lie as near as
those of right ids do, within a share t of the distance of the images (`MISFIT_OF_RIGHT`). What does not agree must lie
`OFF_BEYOND` times t off, as numbers do that are exchanged or a row off: a body that bends, a principal distance or a
unit that is wrong leave what is in between. It is control, and most of it agrees: positions are off by strips and
cameras, whose own tests tell, and a kind that is wrong as a whole is another matter.

Source: Fischler and Bolles 1981, Random sample consensus.
"""

from itertools import combinations

import numpy as np

from aatri.arrays import Bool, Float
from aatri.geometry.similarity import IDENTITY, closed_form, transform
from aatri.observations.control import KIND as CONTROL
from aatri.orientation.bodies.datum_analysis import GivenPlaces
from aatri.orientation.bodies.datum_start import looks_upwards, typical_distance
from aatri.orientation.bodies.free_body import FreeBody
from aatri.orientation.bodies.limits import COLLINEAR_PLACES, FEWEST_AGREEING, MISFIT_OF_RIGHT, OFF_BEYOND

MOST_TRIPLES = 500
"""Triples tried, drawn at random beyond: with half of the places right 1 of 8 is, and 500 miss all of them in 1e-29."""


def agreeing_places(places: GivenPlaces, x: Float, body: FreeBody, up: Float | None) -> Bool | None:
    """Which places known in full agree, (n,), where all others are far off; None where no such agree.

    Parameters
    ----------
    x : (n, 3) float64
        The places in the body.
    up : (3,) float64, optional
        Direction against the mean viewing direction, in the axes of `x`.
    """
    full = np.flatnonzero(places.given.all(axis=1))
    if len(full) <= FEWEST_AGREEING:
        return None
    agree, far, least = np.zeros(len(full), dtype=bool), np.zeros(len(full), dtype=bool), np.inf
    of_right = MISFIT_OF_RIGHT * typical_distance(body, IDENTITY)
    for chosen in _triples(len(full)):
        rows = full[list(chosen)]
        spread = np.linalg.svd(x[rows] - x[rows].mean(axis=0), compute_uv=False)
        if spread[1] ** 2 <= COLLINEAR_PLACES * spread[0] ** 2:
            continue
        to = closed_form(x[rows], places.observed_m[rows])
        if up is not None and looks_upwards(to, up):
            continue
        off = np.linalg.norm(transform(to, x[full]) - places.observed_m[full], axis=1)
        share = off / (to.scale * of_right)
        disagreement = float(np.minimum(share, OFF_BEYOND).sum())
        if disagreement < least:
            agree, far, least = share <= 1.0, share > OFF_BEYOND, disagreement
    if agree.sum() < FEWEST_AGREEING or not (agree | far).all() or agree.all():
        return None
    is_control = places.kind[full] == CONTROL
    if not agree[~is_control].all() or 2 * np.count_nonzero(agree & is_control) <= np.count_nonzero(is_control):
        return None
    result = np.zeros(len(places.row), dtype=bool)
    result[full[agree]] = True
    return result


def _triples(n: int) -> list[tuple[int, ...]]:
    """All triples of n, or so many at random; the same each time."""
    if n * (n - 1) * (n - 2) // 6 <= MOST_TRIPLES:
        return list(combinations(range(n), 3))
    rng = np.random.default_rng(n)
    return [tuple(rng.choice(n, 3, replace=False).tolist()) for _ in range(MOST_TRIPLES)]
