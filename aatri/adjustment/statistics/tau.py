"""The tau test: a residual standardised by the sigma0 of its own adjustment.

    tau = w / sigma0,    tau^2 r / (r - tau^2) (r - 1) / r = t^2,    tau_crit = t sqrt(r) / sqrt(r - 1 + t^2)

w is standardised by the sigmas a priori, r is the redundancy, t the quantile of Student's distribution with r - 1
degrees of freedom at the level of the limit of |w|.

Source: Pope 1976, The statistics of residuals and the detection of outliers.
"""

import numpy as np
from scipy.special import ndtr, stdtrit


def tau_limit(limit: float, redundancy: int) -> float:
    """Limit of |tau| at the level at which `limit` is that of |w|; infinite where nothing can be tested.

    Parameters
    ----------
    limit : float
        In standard deviations.
    """
    if redundancy < 2:
        return float("inf")
    quantile = -float(stdtrit(redundancy - 1, ndtr(-limit)))
    return float(quantile * np.sqrt(redundancy) / np.sqrt(redundancy - 1 + quantile**2))
