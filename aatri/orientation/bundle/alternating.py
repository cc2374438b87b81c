"""Bundle adjustment by alternation: all images by resection, all points by intersection, in turn.

Each half makes the same sum of squares smaller, with the other half held, and falls into one small problem per image
or point. It comes near the bundle slowly: by a constant factor a round, the nearer to 1 the more images a point ties.
It has ended when the Newton step of the whole block is below the tolerance (Newton decrement sqrt(g'dx)), which is
looked at every few rounds; sigma0 is that of the bundle then. There are no standard deviations: those of the halves
leave out what the other half would move.

Source: lecture notes A908 (two-class approximation); docs/formulas.md 4.5.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.errors import ConvergenceError
from aatri.notes import Note
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult, from_result
from aatri.orientation.bundle.settings import BundleSettings
from aatri.progress import SILENT, Reporter

EVERY = 5
"""Rounds between two looks at the whole block, at first; later as many as have been made already."""


def adjust_alternating(
    given: BundleInput, settings: BundleSettings, *, max_rounds: int, reporter: Reporter = SILENT
) -> BundleResult:
    """Adjust a block by alternation.

    Parameters
    ----------
    given : BundleInput
    settings : BundleSettings
    max_rounds : int

    Raises
    ------
    ConvergenceError
        If the whole block has not converged after so many rounds.
    """
    half = replace(settings, covariances=False)
    whole = replace(half, solution=replace(settings.solution, max_iterations=1))
    images, points = np.ones(len(given.image_ids), dtype=bool), np.ones(len(given.point_ids), dtype=bool)
    look = EVERY
    for done in range(1, max_rounds + 1):
        given = from_result(given, adjust_bundle(replace(given, held_points=points), half))
        given = from_result(given, adjust_bundle(replace(given, held_images=images), half))
        reporter.progress(done, max_rounds, "rounds of resection and intersection")
        if done in (look, max_rounds):
            try:
                result = adjust_bundle(given, whole)
            except ConvergenceError:
                look += max(EVERY, done // 2)
                continue
            note = Note("note", f"{done} rounds of resection and intersection; no standard deviations")
            return replace(result, notes=(*result.notes, note))
    raise ConvergenceError(
        f"resection and intersection in turn have not converged in {max_rounds} rounds",
        remedy="raise max_rounds, or adjust with bundle_adjustment/bundle",
    )
