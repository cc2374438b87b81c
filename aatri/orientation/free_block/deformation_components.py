"""Variance components of deformations that an adjustment did not have, from its residuals.

The misfit g of deformations z to the residuals has the covariance phi S + S theta S, S their normal matrix with all
that the adjustment did estimate eliminated, phi the variance of unit weight. With the most probable z,

    z = (S / phi + 1 / theta)^-1 g / phi,      r = tr(S / phi (S / phi + 1 / theta)^-1),      theta = z'z / r

summed over each component and repeated until nothing changes: Foerstner's estimate. With y'y the sum of squares of the
adjustment and f its redundancy phi = (y'y - z'g) / f, by maximum likelihood of the residuals.

Source: Foerstner 1979, as adjustment.statistics.variance_components; Harville 1977 (phi).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float, Int

ROUNDS = 100
SETTLED = 1e-2


@dataclass(frozen=True)
class DeformationComponents:
    """Variances theta and redundancies of the components, (n,) float64 each, and the variance of unit weight."""

    variance: Float
    redundancy: Float
    phi: float


def deformation_components(
    S: Float, g: Float, component: Int, squares: float, redundancy: int, least: float
) -> DeformationComponents:
    """Estimate the variances.

    Parameters
    ----------
    S : (m, m) float64
        Normal matrix of deformations of unit variance.
    g : (m,) float64
        Their misfit.
    component : (m,) int
    squares : float
        Sum of squares of the adjustment, v'Wv.
    redundancy : int
        Of the adjustment.
    least : float
        The smallest that phi may be.
    """
    n = int(component.max(initial=-1)) + 1
    # To begin with each deformation explains its own misfit.
    share = S.diagonal()
    of = np.maximum(np.bincount(component, minlength=n), 1)
    theta: Float = np.bincount(component, (g / share) ** 2, minlength=n) / of
    phi, r = max(squares / redundancy, least), np.zeros(n)
    for _ in range(ROUNDS):
        before, root = theta, np.sqrt(theta[component])
        inverse = np.linalg.inv(np.eye(len(g)) + root[:, None] * S * root / phi)
        z = root * (inverse @ (root * g)) / phi
        r = np.bincount(component, 1.0 - inverse.diagonal(), minlength=n).astype(np.float64)
        theta = np.bincount(component, z**2, minlength=n) / np.maximum(r, 1e-12)
        phi = max((squares - float(z @ g)) / redundancy, least)
        if (np.abs(theta - before) <= SETTLED * before).all():
            break
    return DeformationComponents(theta, r, phi)
