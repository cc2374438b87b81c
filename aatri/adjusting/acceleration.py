"""Anderson's acceleration of an iteration that converges linearly.

Steps f of Gauss and Newton along weak modes of a problem with large residuals shrink by constant factors. With the
steps p that were taken from each state to the next, F = (f_1 - f_0, ..., f_k - f_(k-1)) and P = (p_0, ..., p_(k-1)),

    min over g of | f_k - F g |_W,   p_k = f_k - (P + F) g,

for a single mode, f_k = r f_(k-1), the sum of all steps that would follow, f_k / (1 - r). W makes the scalars of a kind
equally large. Where it ends is where the iteration ends.

Source: Anderson 1965, Iterative procedures for nonlinear integral equations, J. ACM 12; Walker and Ni 2011, Anderson
acceleration for fixed-point iterations, SIAM J. Numer. Anal. 49.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from aatri.adjustment.covariance.solve import LinearSolution
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Float

SLOWLY = 0.25
"""An iteration is slow where a residual departs from the linear model by more than this share of what it did in the
iteration before: departures shrink with the square of the steps, which shrink by less than half."""

DEPTH = 5
"""Differences of steps that are kept: more than the weak modes that blocks were seen to have."""


def accelerated(steps: Sequence[Mapping[str, Float]], taken: Sequence[Mapping[str, Float]]) -> dict[str, Float]:
    """The step to take.

    Parameters
    ----------
    steps : sequence of k + 1 mappings of str to (n, m) float64
        Steps of the iteration from each state, of each group of unknowns.
    taken : sequence of k such mappings
        The steps that led from each state to the next.

    Examples
    --------
    >>> f = {"x": np.array([[4.0, -2.0]])}
    >>> accelerated([f, {"x": 0.5 * f["x"]}], [f])
    {'x': array([[ 4., -2.]])}
    """
    latest = steps[-1]
    size = {name: np.sqrt((f**2).sum(axis=0)) for name, f in latest.items()}

    def whitened(step: Mapping[str, Float]) -> Float:
        return np.concatenate([(step[name] / np.where(s > 0, s, np.inf)).ravel() for name, s in size.items()])

    F = np.diff([whitened(step) for step in steps], axis=0).T
    g = np.linalg.lstsq(F, whitened(latest), rcond=None)[0]
    after = dict(latest)
    for share, before, now, p in zip(g, steps, steps[1:], taken):
        after = {name: f - share * (p[name] + now[name] - before[name]) for name, f in after.items()}
    return after


class Course:
    """The steps of an iteration so far; where they shrink slowly the next one is accelerated.

    Many long strips side by side bend together as one whole: of such modes steps shrink by a few per cent each.
    """

    def __init__(self, unknowns: Sequence[Unknowns]) -> None:
        """Of these groups of unknowns; the others are taken as the iteration gives them."""
        self._unknowns = unknowns
        self._steps: list[dict[str, Float]] = []
        self._taken: list[dict[str, Float]] = []
        self._departure = np.inf

    def after(self, state: State, solved: LinearSolution) -> dict[str, Any]:
        """The state to go on from after what was solved at a state."""
        slow, self._departure = solved.departure > SLOWLY * self._departure, solved.departure
        step = {u.name: solved.step[u.name] for u in self._unknowns}
        steps = [*self._steps, step]
        taken = accelerated(steps, self._taken) if slow else step
        self._steps, self._taken = steps[-DEPTH:], [*self._taken, taken][-DEPTH:]
        if not slow:
            return solved.state
        return {**solved.state, **{u.name: u.retract(state[u.name], taken[u.name]) for u in self._unknowns}}
