"""What two blocks say of the same thing: the mean of two measurements, or a conflict that is told.

    x = P^-1 (P1 x1 + P2 x2),    P = P1 + P2,    Pi = Ci^-1 on what i has measured, 0 elsewhere

Two measurements within `sigmas` standard deviations of their difference are one thing measured twice, independently;
beyond that they are a conflict. What is exact in one has to be equal in the other. A measured value goes before a start
value, a role before none, and what one block has not been given is taken from the other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from aatri.arrays import Bool, Float
from aatri.errors import Faults
from aatri.ids import printable

Duplicates = Literal["average", "first", "refuse"]
Conflicts = Literal["refuse", "first"]


@dataclass
class Reconciliation:
    """What becomes of values in which two blocks differ, and what was told of it."""

    first: str
    second: str
    """What the two blocks are called."""
    duplicates: Duplicates
    """What becomes of two measurements that agree: their mean, the first, or an error."""
    conflicts: Conflicts
    """What becomes of values that exclude each other: an error, or the first goes on with a warning."""
    sigmas: float
    """Up to so many standard deviations of their difference two measurements agree."""
    faults: Faults = field(default_factory=Faults)
    warnings: list[str] = field(default_factory=list)
    means: dict[str, list[str]] = field(default_factory=dict)
    """What was averaged, by kind."""

    def conflict(self, what: str, values: Sequence[Any], where: str = "", more: str = "") -> None:
        """Two values that exclude each other."""
        text = f"{what}: {_shown(values[0])} in {self.first}, {_shown(values[1])} in {self.second}{more}"
        if self.conflicts == "first":
            self.warnings.append(f"{text}; that of {self.first} holds")
        else:
            remedy = "correct one, or give it another id (`prefix`, `rename`); `conflicts: first` takes the first"
            self.faults.add(text, where, remedy)

    def measured(self, kind: str, name: str, worst: float, where: str) -> bool:
        """Two measurements, `worst` standard deviations apart: whether they are to be averaged."""
        if worst > self.sigmas or self.duplicates == "refuse":
            what = "too far for one thing" if worst > self.sigmas else "`duplicates: refuse`"
            text = f"{kind} {printable(name)} measured in {self.first} and in {self.second}, "
            text += f"{worst:.1f} standard deviations of the difference apart ({what})"
            if worst > self.sigmas and self.conflicts == "first":
                self.warnings.append(f"{text}; that of {self.first} holds")
            else:
                self.faults.add(
                    text, where, "remove or rename the wrong one, or `duplicates: average` where both are right"
                )
            return False
        if self.duplicates == "average":
            self.means.setdefault(kind, []).append(printable(name))
        return self.duplicates == "average"


def apart(x: Float, C: Float, used: Bool, other: tuple[Float, Float, Bool]) -> tuple[Float, Bool]:
    """Differences of the common components in standard deviations, and which common ones are exact in either, (n,)."""
    y, D, also = other
    both = used & also
    variance = np.diagonal(C) + np.diagonal(D)
    exact = both & ((np.diagonal(C) == 0) | (np.diagonal(D) == 0))
    normal = both & ~exact
    sigmas = np.where(normal, np.abs(np.where(both, x - y, 0.0)) / np.sqrt(np.where(normal, variance, 1.0)), 0.0)
    return sigmas, exact


def mean_of_two(x: Float, C: Float, used: Bool, other: tuple[Float, Float, Bool]) -> tuple[Float, Float]:
    """Weighted mean of two independent measurements and its covariance, each of some components.

    Parameters
    ----------
    x : (n,) float64
    C : (n, n) float64
    used : (n,) bool
    other : the same of the second
        Exact components have to be equal in both.

    Returns
    -------
    x : (n,) float64
        NaN where neither has measured.
    C : (n, n) float64
        Zero where exact.
    """
    y, D, also = other
    exact = (used & (np.diagonal(C) == 0)) | (also & (np.diagonal(D) == 0))
    P, Q = _weights(C, used & ~exact), _weights(D, also & ~exact)
    free = (used | also) & ~exact
    mean = np.where(used, x, y)
    covariance = np.zeros_like(C)
    if free.any():
        inside = np.ix_(free, free)
        covariance[inside] = np.linalg.inv((P + Q)[inside])
        right = P @ np.where(used, x, 0.0) + Q @ np.where(also, y, 0.0)
        mean[free] = covariance[inside] @ right[free]
    return mean, covariance


def _weights(C: Float, used: Bool) -> Float:
    P = np.zeros_like(C)
    if used.any():
        inside = np.ix_(used, used)
        P[inside] = np.linalg.inv(C[inside])
    return P


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"({', '.join(_shown(v) for v in value.ravel())})"
    return f"{value:.10g}" if isinstance(value, float) else printable(str(value)) or "none"
