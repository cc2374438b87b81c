"""Baarda's test of single components, for records that are used and for records that are predicted.

For whitened residuals v with cofactor R = I - A Q A' of the residuals,

    w_i = v_i / sqrt(R_ii),      N(0, 1) without gross error,

and for a record that is not used, with the prediction error v of cofactor I + A Q A', w_i = v_i / sqrt((I + A Q A')_ii).
A component with R_ii below `UNCONTROLLED` has no test: nothing else observes it.

Source: Baarda 1968; docs/formulas.md 7.2, 7.3.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Bool, Float

UNCONTROLLED = 1e-3
"""Redundancy numbers below this control nothing that could be told apart."""


def w_tests(v: Float, adjusted: Float, active: Bool, observed: Bool) -> Float:
    """Test statistics of the components of records.

    Parameters
    ----------
    v : (n, m) float64
        Whitened residuals.
    adjusted : (n, m, m) float64
        Covariance of the whitened adjusted (not active: predicted) values; NaN unknown.
    active : (n,) bool
    observed : (n, m) bool
        Components that were observed.

    Returns
    -------
    (n, m) float64
        NaN where nothing controls the component, or it was not observed.
    """
    spread = np.einsum("nii->ni", adjusted)
    cofactor = np.where(active[:, None], 1.0 - spread, 1.0 + spread)
    told = observed & (cofactor > UNCONTROLLED)
    return np.where(told, v / np.sqrt(np.where(told, cofactor, 1.0)), np.nan)
