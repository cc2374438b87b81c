"""Levenberg-Marquardt damping: when a Gauss-Newton step is refused, and how to come back to it.

The damping lambda multiplies the diagonal of the normal matrix. It is 0 (Gauss-Newton) until a step fails; then it
follows the gain, the decrease of the cost over the decrease the linear model predicts:

    accepted: lambda <- lambda max(1/3, 1 - (2 gain - 1)^3), and 0 once it is small and the model is good
    refused:  lambda <- lambda nu, nu doubling each time

Source: Nielsen 1999, Damping parameter in Marquardt's method.
"""

from __future__ import annotations

from dataclasses import dataclass

FIRST = 1e-3
SMALL = 1e-3
GOOD = 0.75


@dataclass(frozen=True)
class Damping:
    """Damping of the next step: `value`, and the factor `growth` that applies if it is refused."""

    value: float = 0.0
    growth: float = 2.0

    def accepted(self, gain: float) -> Damping:
        """After a step that was taken."""
        if self.value <= SMALL and gain > GOOD:
            return Damping()
        return Damping(self.value * max(1 / 3, 1 - (2 * min(gain, 1.0) - 1) ** 3))

    def refused(self) -> Damping:
        """After a step that was refused."""
        if self.value == 0.0:
            return Damping(FIRST)
        return Damping(self.value * self.growth, 2 * self.growth)


def gain(cost: float, trial: float, predicted: float) -> float:
    """Decrease of the cost over the predicted decrease.

    Parameters
    ----------
    cost, trial : float
        v'v before and after the step.
    predicted : float
        Decrease of the linear model, positive.
    """
    return (cost - trial) / predicted if predicted > 0 else 0.0
