"""How far strips are deformed, and whether that can be.

Each model of a strip joins the one before with errors of rotation and scale of the size of its points' own errors s.
They add up twice along the strip (Vermeir 1954; Ackermann 1965). White noise summed twice over n models, less its best
shift and tilt, is about 0.05 n^1.5 s (RMS; the root of 1/420 is 0.049), so that strips of n models are expected to
differ from each other and from the ground by

    expected = 1 + 0.05 n^1.5

times the standard deviations of their points: 8 times for 27 models, 50 times for 100. That is the ratio sigma0 of the
adjustments of whole strips, in which tau, the deformation added to the standard deviations of the points, is *not*
counted. How much strips in fact deform depends on their points and overlaps, hence this is a gauge of one digit: beyond
`max_sigma0` times what is expected points, ids or frames are mixed up, or the standard deviations are guessed: that is
told from the size of the misfit (`Misfit`).

With tau counted sigma0 is near 1 by construction wherever tau had to be added, so that its test warns where gross
errors are left. Where strips agree better than the standard deviations of their points say it is small, which the
stages before have told of their image points: here that is a note.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.adjusting.tied_adjustment import TiedResult
from aatri.adjustment.statistics.global_test import GlobalTest, global_test, pooled_test, sigma0_note, single_misfits
from aatri.adjustment.statistics.limits import MAX_SIGMA0
from aatri.arrays import Bool, Float, Int, Text
from aatri.errors import ConvergenceError
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.ties import BODY
from aatri.orientation.bodies.limits import FAR_LESS, FIFTH_OF_FOUR, MISFIT_OF_RIGHT

if TYPE_CHECKING:
    from aatri.artifacts.strips import Strips


GROWTH = 0.05

MOST_NAMED = 3
"""So many bodies are named where they do not fit."""

CALLED = {
    "control": "control point {1}",
    "position": "position of image {0}",
    "attitude": "attitude of image {0}",
    "strip_tie": "point {1} in strip {0}",
    "model_tie": "point {1} in model {0}",
    "perspective_centre": "centre of image {1} in model {0}",
}
"""What messages call an observation of a kind, by its ids of image (or body) and point."""

OF_GIVEN = "of control, the deformation counted,"


def bends_far_less(without: TiedResult, with_all: TiedResult) -> bool:
    """Whether a body is deformed far less without what is far from its start: that bends it.

    Of variances F = s1^2 / s2^2 the probability of small ones begins with F^(r / 2), r the redundancy of the first,
    whatever that of the second is.
    """
    r = without.redundancy
    return r > 1 and without.tau_m < min(FAR_LESS, FIFTH_OF_FOUR ** (1 / r)) * with_all.tau_m


def expected_ratio(models: int) -> float:
    """Expected ratio of the deformation of strips of so many models to the standard deviations of their points."""
    return 1.0 + GROWTH * float(models * np.sqrt(models))


@dataclass(frozen=True)
class Misfit:
    """From where on strips and control do not fit."""

    max_sigma0: float | None
    """Largest ratio to what deformation explains. None: `MAX_SIGMA0`, and only where the misfit is also more than
    `MISFIT_OF_RIGHT` of the distance; the bundle can begin from less."""
    distance_m: float
    """From the projection centres to the points."""
    oriented: bool = False
    """An earlier stage has held the bodies against the ground: what begins from there can go on from a larger misfit
    too, as that of models of few points is, and without `max_sigma0` it is a warning."""
    farthest: str = ""
    """The bodies that are farthest off, for messages."""

    def notes(self, sigma0: float, expected: float, off_m: float, what: str, reason: str) -> list[Note]:
        """A warning where sigma0 is beyond the limit and the misfit is small.

        Raises
        ------
        ConvergenceError
            Where the misfit is large, or `max_sigma0` is given.
        """
        limit = MAX_SIGMA0 if self.max_sigma0 is None else self.max_sigma0
        if not (np.isfinite(sigma0) and sigma0 > limit * expected):
            return []
        text = f"{what}: sigma0 is {sigma0:.3g}, beyond max_sigma0 = {limit:g}{reason}: strips and control do not fit "
        text += f"each other{self.farthest}"
        remedy = (
            "check ids of points and control, units and axes of control, strips and models of the images; "
            "standard deviations that are too small by this factor are to be corrected in the block"
        )
        if self.max_sigma0 is not None or not (self.oriented or off_m <= MISFIT_OF_RIGHT * self.distance_m):
            raise ConvergenceError(text, remedy=remedy)
        share = f"{off_m:.2g} m (RMS), {off_m / self.distance_m:.1%} of the distance of the images"
        return [Note("warning", f"{text}, but by {share}: the bundle can begin from there; {remedy}")]


def rms_m(residual_m: Float, active: Bool) -> float:
    """RMS length of the residuals in use, (n, 3), m; those that vanish, of points observed once, do not count."""
    squares = np.nansum(residual_m[active] ** 2, axis=1)
    squares = squares[squares > 0]
    return float(np.sqrt(squares.mean())) if len(squares) else 0.0


def farthest_bodies(tied: TiedResult, names: Text) -> str:
    """The bodies whose ties in use are farthest off (RMS), for messages."""
    o = tied.problem.ties[0]
    body, used = dict(o.records.touches)[BODY], tied.active[: len(o)]
    squares = np.nansum(tied.residuals[: len(o)] ** 2, axis=1) * used
    off_m = np.sqrt(np.bincount(body, squares, len(names)) / np.maximum(np.bincount(body, squares > 0, len(names)), 1))
    worst = np.argsort(-off_m, kind="stable")[:MOST_NAMED]
    return f"; farthest off: {', '.join(f'{names[k]} {off_m[k]:.2g} m (RMS)' for k in worst)}"


def sigma0_notes(
    tied: Sequence[TiedResult],
    names: Sequence[str],
    sigma0: float,
    models: int,
    misfit: Misfit,
    off_m: float,
    what: str,
) -> list[Note]:
    """sigma0 of one or several adjustments of strips: its test, pooled, the single ones, and what the ratio means.

    Parameters
    ----------
    names : sequence of str
        Of each, for messages.
    sigma0 : float
        Ratio to the a priori standard deviations of all together.
    models : int
        Of the longest strip.
    off_m : float, m
        RMS of what does not fit.

    Raises
    ------
    ConvergenceError
        If no deformation explains the misfit.
    """
    expected = expected_ratio(models)
    reason = f" times the {expected:.2g} that strips of {models} models lead one to expect"
    notes = misfit.notes(sigma0, expected, off_m, what, reason)
    ratios: Float = np.array([t.weighted_sigma0 for t in tied])
    redundancy: Int = np.array([max(t.redundancy, 0) for t in tied])
    test = pooled_test(ratios, redundancy)
    what_of_it = "with the deformation of the strips counted"
    small = test.verdict != "untested" and test.sigma0 < 1
    notes.append(sigma0_note(replace(test, verdict="fits") if small else test, what_of_it))
    notes += misfit.notes(test.sigma0, 1.0, off_m, f"{what}, deformation counted", "")
    undeformed = np.array([t.tau_m == 0 for t in tied])  # among them those of too few observations to tell it
    misfits = np.flatnonzero(single_misfits(np.where(undeformed, ratios / expected, ratios), redundancy))
    if len(tied) > 1 and len(misfits):
        notes.append(
            Note("warning", "adjustments that do not fit by themselves", tuple(names[k] for k in misfits.tolist()))
        )
    if np.isfinite(sigma0):
        notes.append(
            Note(
                "note",
                f"strips deform by {sigma0:.3g} times the standard deviations of their points; strips of "
                f"{models} models lead one to expect about {expected_ratio(models):.2g} times",
            )
        )
    return notes


def given_note(tied: TiedResult) -> Note:
    """Whether control fits the strips, the deformation counted; a warning beyond 0.5 to 2.

    What polynomials leave of the deformation is smooth, so that control fits somewhat worse than ties: less than that
    is a note.
    """
    test: GlobalTest = global_test(tied.ground_sigma0, round(tied.ground_redundancy))
    if test.verdict in ("warned", "far") and (test.verdict == "warned" or test.sigma0 < 1):
        test = replace(test, verdict="fits")
    return sigma0_note(test, OF_GIVEN)


def search_notes(tied: TiedResult, what: str) -> list[Note]:
    """What the search for gross errors leaves open."""
    notes = []
    kept = np.flatnonzero(tied.above)
    if len(kept):
        text = f"{what}: above the limit but not rejected, as too little else controls them or too many are rejected"
        notes.append(Note("warning", text, tuple(names_of(tied, kept))))
    if tied.bent.any():
        text = f"{what}: {several(int(tied.bent.sum()), 'tie')} above the limit stay: they agree with those beside them"
        notes.append(Note("note", f"{text}, where their bodies bend"))
    if not tied.settled:
        notes.append(Note("warning", f"{what}: the search for gross errors was broken off before it settled"))
    return notes


def names_of(result: TiedResult, rows: Int) -> list[str]:
    """What messages call some of all observations."""
    texts = []
    for row in rows.tolist():
        k = int(np.searchsorted(result.problem.edges, row, side="right")) - 1
        o = result.problem.observed[k]
        image, point = o.names(np.array([row - result.problem.edges[k]]))
        texts.append(CALLED.get(o.kind, f"{o.kind} {{0}}{{1}}").format(image[0], point[0]))
    return texts


def most_models(strips: Strips) -> int:
    """Models of the longest strip."""
    return int(np.bincount(strips.strip_images.strip).max(initial=1)) - 1


def distance_m(position_m: Float, point_m: Float) -> float:
    """From the middle of the projection centres to that of the points, m."""
    return float(np.linalg.norm(np.nanmean(position_m, axis=0) - np.nanmean(point_m, axis=0)))
