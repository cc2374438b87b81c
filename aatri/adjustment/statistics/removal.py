"""Which parameters of a group to leave out: not determined, not separable, not significant.

A parameter held at zero changes the others, in the linear model exactly, by

    p <- p - C_.i p_i / C_ii,    C <- C - C_.i C_i. / C_ii

so that one after the other can be taken out without a new adjustment between. The order is: what the data do not
determine; one of two that cannot be told apart (|correlation| >= 0.999), the less significant; what is not significant,
smallest |t| first. Tests are repeated after each step: a parameter that looked idle beside its twin may be
significant alone.

Source: Gruen 1980, Precision and reliability aspects in close-range photogrammetry.
"""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.limits import INSEPARABLE, UNDETERMINED_SHARE
from aatri.adjustment.statistics.significance import Estimates, correlated_pairs, parameter_tests

CELLS = 4000
"""Of the interval over which a likelihood is summed: of 10,000 parameters it is some 50 cells wide."""


@dataclass(frozen=True)
class Removal:
    """A parameter to leave out, and why: by a test of its value, or because the data do not tell it from others."""

    name: str
    reason: str
    by_test: bool = False


def held_at_zero(e: Estimates, name: str) -> Estimates:
    """The other parameters' estimates if one is held at zero."""
    i = e.names.index(name)
    rest = np.arange(len(e.names)) != i
    if not np.isfinite(e.covariance[i, i]):
        gain = np.zeros(len(e.names))
    else:
        gain = e.covariance[:, i] / e.covariance[i, i]
    values = e.values - gain * (e.values[i] if np.isfinite(e.values[i]) else 0.0)
    covariance = e.covariance - np.outer(gain, np.where(np.isfinite(e.covariance[i]), e.covariance[i], 0.0))
    names = tuple(n for n in e.names if n != name)
    return Estimates(names, values[rest], covariance[np.ix_(rest, rest)], e.prior_sigma[rest], e.sigma0, e.redundancy)


def propose_removal(e: Estimates, alpha: float = 0.05) -> Removal | None:
    """The parameter to leave out next, or None if all that remain are determined, separable and significant."""
    tests = parameter_tests(e, alpha)
    share = np.where(np.isfinite(tests.data_share), tests.data_share, -1.0)
    if share.min(initial=1.0) < UNDETERMINED_SHARE:
        i = int(share.argmin())
        cause = "not determined" if share[i] < 0 else f"only {share[i]:.0%} of its value comes from the data"
        return Removal(e.names[i], cause)
    strength = np.where(np.isfinite(tests.t), np.abs(tests.t), -1.0)
    for pair in correlated_pairs(e, INSEPARABLE)[:1]:
        less, more = sorted(
            (pair.first, pair.second), key=lambda name: (strength[e.names.index(name)], e.names.index(name))
        )
        return Removal(less, f"cannot be told from {more}: correlation {pair.correlation:.5f}")
    if not tests.significant.all():
        i = int(np.where(tests.significant, np.inf, strength).argmin())
        return Removal(
            e.names[i], f"not significant: |t| = {strength[i]:.2f}, p = {tests.p_value[i]:.2f}", by_test=True
        )
    return None


def stepwise_removal(e: Estimates, alpha: float = 0.05) -> tuple[Estimates, tuple[Removal, ...]]:
    """Leave out one parameter after the other until all that remain are worth keeping.

    Returns
    -------
    Estimates
        Of the parameters that remain, as a new adjustment would give them (but for its non-linearity).
    tuple of Removal
        What was left out, in order.
    """
    removals: list[Removal] = []
    while (removal := propose_removal(e, alpha)) is not None:
        removals.append(removal)
        e = held_at_zero(e, removal.name)
    return e, tuple(removals)


def size_of_idle(chi_square: float, count: int) -> tuple[float, float]:
    """How much of their variance, and of the square of their estimates, parameters may be that no test has found.

    They are taken as p ~ N(0, g P), P the covariance of their estimates p_f, so that of p is known

        E(p p') = w P + w^2 p_f p_f',     w = g / (1 + g)

    g is not known: each w between 0 and 1 is as likely beforehand, and chi_square = p_f' P^-1 p_f tells more of it.

    Parameters
    ----------
    count : int
        Of the parameters.

    Returns
    -------
    E(w), E(w^2) : float

    Source: Strawderman 1971; Liang, Paulo, Molina, Clyde, Berger 2008, Mixtures of g priors (hyper-g, a = 4).
    """
    u = (np.arange(CELLS) + 0.5) / CELLS  # 1 - w
    log = 0.5 * count * np.log(u) - 0.5 * chi_square * u
    likely = np.exp(log - log.max())
    likely /= likely.sum()
    return float(likely @ (1 - u)), float(likely @ (1 - u) ** 2)
