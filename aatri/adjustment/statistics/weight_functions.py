"""Weight functions of robust adjustment: how much an observation counts, by the size s of its standardised residual.

With the bound k, every w is 1 for s <= k and falls beyond:

    huber          k / s                                          Huber 1964
    danish         exp(1 - (s/k)^2)                               Krarup, Juhl and Kubik 1980
    igg3           k/s ((k1 - s) / (k1 - k))^2, 0 from k1 = 3k    Yang 1994; 2002: k 2 to 3, k1 4.5 to 8.5
    li_posterior   1 / s^2                                        Li Deren 1983: p = sigma0^2 / sigma^2, sigma^2 = v^2/r
    cauchy         1 / (1 + (s/k)^2), from s = 0 on               Holland and Welsch 1977

s is |v| / sigma; for `li_posterior` |v| / (sigma sqrt(r)), r the redundancy number, so that s^2 is the a-posteriori
variance over that a priori, and k the root of the critical value of its F-test.

Adjusted with the weights of the residuals before, again and again, the sum of rho falls, d rho / ds = 2 s w, for each
rho is concave in s^2. All but Huber's have more than one minimum: they need a start near the right one.
"""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from aatri.arrays import Float

Weighting = Literal["huber", "danish", "igg3", "li_posterior", "cauchy"]

BOUNDS: Mapping[Weighting, float] = {"huber": 2.0, "danish": 2.5, "igg3": 2.0, "li_posterior": 3.29, "cauchy": 2.385}
"""Bounds in standard deviations where none is given: with Cauchy's a normal sample keeps 95 % of its information; Li's
is the critical value at 0.1 %."""

REACH = 3.0
"""k1 of igg3 over its k."""

FLOOR = 1e-6
"""Least weight: what is weighted out altogether still leaves its point a place."""


def weights(weighting: Weighting, s: Float, k: float) -> Float:
    """Weights of residuals.

    Parameters
    ----------
    s : (n,) float64
        Size of the standardised residuals.
    k : float
        Bound, positive.

    Returns
    -------
    (n,) float64, from `FLOOR` to 1

    Examples
    --------
    Huber's weights are 1 within the bound and fall as 1 / s beyond it:

    >>> weights("huber", np.array([1.0, 2.0, 8.0]), 2.0)
    array([1.  , 1.  , 0.25])
    """
    far = np.maximum(s / k, 1.0)
    if weighting == "huber":
        w = 1.0 / far
    elif weighting == "danish":
        w = np.exp(1.0 - far**2)
    elif weighting == "igg3":
        w = (np.maximum(REACH - far, 0.0) / (REACH - 1.0)) ** 2 / far
    elif weighting == "li_posterior":
        w = np.where(far > 1.0, 1.0 / np.maximum(s, k) ** 2, 1.0)
    else:
        w = 1.0 / (1.0 + (s / k) ** 2)
    return np.asarray(np.maximum(w, FLOOR))
