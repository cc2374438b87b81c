"""Errors with longer tails than normal ones: from where on a residual is no longer explained by them.

Good measurements have errors with longer tails than normal ones, nearly as Student's distribution of nu degrees of
freedom; images of unlike quality, taken together, as well. Then a |w| of 6 is chance once in some thousand. The tail is
read from the middle: of the |w| below `TAIL_REACH` limits the scale s and nu maximise the likelihood of the counts n_b
in classes of size between e_b and e_b+1, given that they lie there,

    ln L = sum n_b ln((1 - g) (F(e_b+1) - F(e_b)) / F(e_B) + g / B),      F(e) = P(|s t_nu| <= e)

Gross errors are beyond, and have no say but for their share g among the B classes: from e_B to 2 e_B there are more
than the tail explains, and as many below e_B, as gross errors are about as dense there. So a tenth of errors that are
eight times as large as the others is told from a tail, whose errors thin out. Of few residuals many nu are nearly as
likely: taken is the least that they allow, at the level 5 % (one-sided, ln L less than 1.35 below the largest), for
what such a tail explains is no gross error. nu is not below `LEAST_FREEDOM`: longer tails are gross errors. The limit
is the value that `BEYOND_TAIL` of such errors exceed, where that is larger than the limit of normal ones: of 3,000
normal residuals it stays, of 500 it is 5.

Source: Wilks 1938 (likelihood intervals); Jeffreys 1961, Theory of Probability, 5.7 (series of observations have nu of
4 to 9); Lange, Little and Taylor 1989, Robust statistical modeling using the t distribution.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri, ndtr, stdtr, stdtrit

from aatri.adjustment.statistics.limits import (
    BEYOND_TAIL,
    FEWEST_FOR_TAIL,
    LEAST_FREEDOM,
    MEDIAN_OF_NORMAL,
    MOST_GROSS,
    TAIL_REACH,
)
from aatri.arrays import Float

ALLOWED = 0.5 * float(chdtri(1.0, 0.10))
"""Fall of ln L from its largest value to the end of a one-sided interval of 95 %."""

_CLASSES = 32
_FREEDOM = 1.0 / np.linspace(0.01, 1.0 / LEAST_FREEDOM, 13)
_SCALES = np.exp(np.linspace(-0.3, 0.3, 31))


@dataclass(frozen=True)
class Tail:
    """The tail of the errors of a class of observations."""

    freedom: float
    """Degrees of freedom of Student's distribution; infinite where a normal one explains the residuals."""
    limit: float
    """|w| beyond which an error is not explained by it."""


def tail_of(w: Float, limit: float) -> Tail:
    """The tail of some residuals.

    Parameters
    ----------
    w : (n,) float64
        Sizes of standardised residuals.
    limit : float
        That of normal ones.

    Examples
    --------
    >>> from scipy.special import ndtri, stdtrit
    >>> levels = (np.arange(2000) + 0.5) / 2000
    >>> tail_of(np.abs(ndtri(levels)), 4.7)
    Tail(freedom=inf, limit=4.7)
    >>> 4 <= tail_of(np.abs(stdtrit(5, levels)), 4.7).freedom <= 5
    True
    """
    normal = Tail(np.inf, limit)
    middle = float(np.median(w)) / MEDIAN_OF_NORMAL if len(w) >= FEWEST_FOR_TAIL else 0.0
    if middle <= 0:
        return normal
    edges = np.linspace(0.0, TAIL_REACH * limit, _CLASSES + 1)
    count, beyond_reach = np.histogram(w, edges)[0], float(((w > edges[-1]) & (w <= 2 * edges[-1])).sum())
    e = np.append(edges, 2 * edges[-1]) / (middle * _SCALES[:, None])
    by_normal = _log_likelihood(count, beyond_reach, len(w), ndtr(e)).max()
    by_student = np.array([_log_likelihood(count, beyond_reach, len(w), stdtr(nu, e)) for nu in _FREEDOM])
    likely = np.flatnonzero(by_student.max(axis=1) >= max(by_normal, by_student.max()) - ALLOWED)
    if not len(likely):
        return normal
    nu = int(likely[-1])
    scale = int(by_student[nu].argmax())
    beyond = -middle * _SCALES[scale] * float(stdtrit(_FREEDOM[nu], 0.5 * BEYOND_TAIL))
    return Tail(float(_FREEDOM[nu]), beyond) if beyond > limit else normal


def _log_likelihood(count: Float, beyond_reach: float, n: int, below: Float) -> Float:
    """Of counts in classes of size, (k,), by probabilities of being below the edges and twice the last.

    `beyond_reach` of all n residuals lie between the last edge and twice that.
    """
    explained = 2 * n * (below[:, -1:] - below[:, -2:-1])
    gross = np.clip((beyond_reach - explained) / max(count.sum(), 1), 0.0, MOST_GROSS)
    share = np.diff(below[:, :-1], axis=1) / (below[:, -2:-1] - 0.5)
    return np.asarray(np.log(np.maximum((1.0 - gross) * share + gross / len(count), 1e-300)) @ count)
