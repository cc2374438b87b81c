"""Levenberg-Marquardt damping: when a Gauss-Newton step is refused, and how to come back to it.

The damping lambda multiplies the diagonal of the normal matrix. It is 0 (Gauss-Newton) until a step fails; then it
follows the gain, the decrease of the cost over the decrease the linear model predicts:

    accepted: lambda <- lambda max(1/3, 1 - (2 gain - 1)^3)
    refused:  lambda <- lambda nu, nu doubling each time

An undamped step is tried again once lambda is below a threshold and the model is good; each time it is refused the
threshold falls, so that a problem that needs a little damping to its end is not held up.

Source: Nielsen 1999, Damping parameter in Marquardt's method.
"""

from __future__ import annotations

from dataclasses import dataclass

FIRST = 1e-3
GOOD = 0.75
SHRINK = 0.03
ROUNDING = 1e-10
"""A smaller relative decrease of the cost is not judged: rounding hides it."""


@dataclass(frozen=True)
class Damping:
    """Damping of the next step."""

    value: float = 0.0
    growth: float = 2.0
    """The factor that applies if the step is refused."""
    threshold: float = 2 * FIRST
    """Below it an undamped step is tried."""

    def accepted(self, gain: float) -> Damping:
        """After a step that was taken."""
        if self.value < self.threshold and gain > GOOD:
            return Damping(0.0, 2.0, self.threshold)
        return Damping(self.value * max(1 / 3, 1 - (2 * min(max(gain, 0.0), 1.0) - 1) ** 3), 2.0, self.threshold)

    def refused(self) -> Damping:
        """After a step that was refused."""
        if self.value == 0.0:
            return Damping(min(FIRST, self.threshold), 2.0, SHRINK * self.threshold)
        return Damping(self.value * self.growth, 2 * self.growth, self.threshold)


def gain(cost: float, trial: float, predicted: float) -> float:
    """Decrease of the cost over the predicted decrease.

    Parameters
    ----------
    cost, trial : float
        v'v before and after the step.
    predicted : float
        Decrease of the linear model, positive.

    Returns
    -------
    float
        1 where the predicted decrease is lost in the rounding of the cost.
    """
    if predicted <= ROUNDING * cost:
        return 1.0
    return (cost - trial) / predicted
