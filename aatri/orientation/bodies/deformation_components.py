"""Variance components of deformations that an adjustment did not have, from its residuals.

The misfit g of deformations z to the residuals has the covariance phi S + S theta S, S their normal matrix with all
that the adjustment did estimate eliminated, phi the variance of unit weight. With the most probable z,

    z = (S / phi + 1 / theta)^-1 g / phi,      r = tr(S / phi (S / phi + 1 / theta)^-1),      theta = z'z / r

summed over each component and repeated until nothing changes: Foerstner's estimate. After every two steps the rest is
taken to fall on as they did (Aitken). With y'y the sum of squares of the adjustment and f its redundancy
phi = (y'y - z'g) / f, by maximum likelihood of the residuals.

Source: Foerstner 1979, as adjustment.statistics.variance_components; Harville 1977 (phi).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from aatri.arrays import Float, Int

ROUNDS = 100
SETTLED = 1e-2
FALLING = 0.9
"""Factors of the differences from which on nothing is told of the limit."""


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
    if not n:
        return DeformationComponents(np.zeros(0), np.zeros(0), max(squares / redundancy, least))
    # To begin with each deformation explains its own misfit.
    share = S.diagonal()
    of = np.maximum(np.bincount(component, minlength=n), 1)
    theta: Float = np.bincount(component, (g / share) ** 2, minlength=n) / of
    phi, r, steps = max(squares / redundancy, least), np.zeros(n), [theta]
    for _ in range(ROUNDS):
        before, root = theta, np.sqrt(theta[component] / phi)
        # Of M = I + root S root = L L' the inverse is wanted on the diagonal, and times one vector.
        M = S * root
        M *= root[:, None]
        np.einsum("ii->i", M)[:] += 1.0
        L, fails = dpotrf(M.T, lower=True, overwrite_a=True)
        if fails:  # of points at infinity S is a difference of large numbers, and no longer semidefinite
            values, vectors = np.linalg.eigh(S)
            S = (vectors * np.maximum(values, 0.0)) @ vectors.T
            continue
        L_inverse = dtrtri(L, lower=True, overwrite_c=True)[0]
        z = root * (L_inverse.T @ (L_inverse @ (root * g)))
        r = np.bincount(component, 1.0 - np.einsum("ij,ij->j", L_inverse, L_inverse), minlength=n).astype(np.float64)
        theta = np.bincount(component, z**2, minlength=n) / np.maximum(r, 1e-12)
        phi = max((squares - float(z @ g)) / redundancy, least)
        if (np.abs(theta - before) <= SETTLED * before).all():
            break
        steps.append(theta)
        if len(steps) == 3:
            theta = _limit(*steps)
            steps = [theta]
    return DeformationComponents(theta, r, phi)


def _limit(first: Float, second: Float, third: Float) -> Float:
    """Where values lead whose logarithms differ by less and less, by a constant factor; the third where they do not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        before, last = np.log(second / first), np.log(third / second)
        factor = last / before
        falling = np.isfinite(factor) & (factor > 0) & (factor < FALLING)
        return np.where(falling, third * np.exp(np.where(falling, last * factor / (1 - factor), 0.0)), third)
