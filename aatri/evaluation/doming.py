"""Doming: heights that bend from the middle of the block to its edge, and check points far off.

    dZ = a + b r^2,    sag = b r_max^2

over control and check points, r the plan distance from their middle. Images that look straight down carry an
uncorrected radial distortion, a wrong principal distance or refraction into such a bend, which control at the edges
does not show. A bend is told where Student's test of b finds it (0.1 %), and where it is beyond what the standard
deviations of the heights allow: where they are large, in the middle of a block with control at its edges, errors of
neighbouring points are alike, and bend without any distortion. Errors of models and strips add up to bends, too: where
no height has a standard deviation, as after absolute orientation, the bend is a note.

Source: James and Robson 2014 (systematic errors of vertical blocks: doming).
"""

import numpy as np

from aatri.adjustment.statistics.limits import ALARM, WRONG_SIGMAS
from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.evaluation.limits import FEWEST_FOR_DOMING, ROUNDED_BEND_M
from aatri.ids import rows_of
from aatri.notes import FAR_OFF, Note
from aatri.units import about


def check_notes(evaluation: Evaluation, block: Block, solution: Solution) -> list[Note]:
    """Warnings of check points far off and of bent heights.

    Parameters
    ----------
    solution : Solution
        That was evaluated.
    """
    from scipy.special import ndtri, stdtrit  # inverse of the normal distribution, and of Student's

    d = evaluation.differences
    is_reference = np.isin(d.kind, ("control", "check"))
    xy = solution.points.xyz_m[rows_of(d.point[is_reference], block.points.id), :2]
    bent = doming(xy, d.difference_m[is_reference, 2])
    notes = _far(evaluation)
    determined = np.isfinite(d.difference_m[is_reference, 2])
    by_chance = 0.0 if bent is None else bent[1] * float(stdtrit(determined.sum() - 2, 1 - ALARM / 2))
    sigma_m = d.sigma_m[is_reference, 2]
    allowed = float(np.nan_to_num(sigma_m).max(initial=0.0)) * float(ndtri(1 - ALARM / 2))
    if bent is not None and abs(bent[0]) > max(by_chance, allowed, ROUNDED_BEND_M):
        notes.append(
            Note(
                "warning" if np.isfinite(sigma_m).any() else "note",
                f"heights bend by {about(bent[0])} (+- {about(bent[1])}) from the middle of control "
                "and check points to their edge: a distortion not corrected, or little height control "
                "inside; oblique images, observed positions or control inside hold them",
            )
        )
    return notes


def doming(xy_m: Float, difference_m: Float) -> tuple[float, float] | None:
    """Sag from the middle to the farthest point, and its standard deviation.

    Parameters
    ----------
    xy_m : (n, 2) float64, m
    difference_m : (n,) float64, m
        Of the heights; NaN where they take no part.

    Returns
    -------
    float, float or None
        None with fewer than six points, or all at one distance.
    """
    determined = np.isfinite(difference_m) & np.isfinite(xy_m).all(axis=1)
    n = int(determined.sum())
    if n < FEWEST_FOR_DOMING:
        return None
    r2 = ((xy_m[determined] - xy_m[determined].mean(axis=0)) ** 2).sum(axis=1)
    u = r2 / r2.max() if r2.max() > 0 else r2
    if np.ptp(u) < 0.1:
        return None
    A = np.column_stack([np.ones(n), u])
    N = np.linalg.inv(A.T @ A)
    x = N @ A.T @ difference_m[determined]
    v = difference_m[determined] - A @ x
    return float(x[1]), float(np.sqrt(v @ v / (n - 2) * N[1, 1]))


def _far(evaluation: Evaluation) -> list[Note]:
    d = evaluation.differences
    rows = np.flatnonzero(d.kind == "check")
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(d.sigma_m[rows] > 0, np.abs(d.difference_m[rows]) / d.sigma_m[rows], 0.0)
    size = np.nan_to_num(ratio).max(axis=1, initial=0.0)
    far = np.argsort(-size, kind="stable")[: int((size > WRONG_SIGMAS).sum())]
    if not len(far):
        return []
    off = np.nan_to_num(np.abs(d.difference_m[rows])).max(axis=1)
    points = tuple(f"{d.point[rows[k]]} ({about(off[k])}, {size[k]:.3g} sigma)" for k in far.tolist())
    return [Note("warning", f"{len(far)} of {len(rows)} check points {FAR_OFF}", points)]
