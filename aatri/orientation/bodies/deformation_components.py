"""Variance components of deformations that an adjustment did not have, from its residuals.

The misfit g of deformations z to the residuals has the covariance phi S + S D S, S their normal matrix with all that
the adjustment did estimate eliminated, phi the variance of unit weight. D is diagonal: the variance of a deformation is
that of its component times the size of its body, d = theta lambda. With the most probable z,

    z = (S / phi + 1 / D)^-1 g / phi,      r = diag(S / phi (S / phi + 1 / D)^-1)

the estimate is, over all deformations of a component and then of a body,

    theta = theta sum z^2 / d / sum r,      lambda = lambda (sum z^2 / d + e) / (sum r + e),      mean of lambda 1,

repeated until nothing changes: Foerstner's. Bodies of one component are much alike, but a strip whose points lie on
one side of it errs by twice as much as others: lambda is told by some ten redundancies each, and begins as if
e = `ESTIMABLE` of them had told that it is 1. After every two steps the rest is taken to fall on as they did (Aitken).
With y'y the sum of squares of the adjustment and f its redundancy phi = (y'y - z'g) / f, by maximum likelihood of the
residuals, whose deviance is (y'y - z'g) / phi + f log phi + log |1 + S D / phi|: where it settles all is done, as
components that do much the same creep towards each other for long.

Source: Foerstner 1979, as adjustment.statistics.variance_components; Harville 1977 (phi).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

from aatri.adjustment.statistics.variance_components import ESTIMABLE
from aatri.arrays import Float, Int

ROUNDS = 100
SETTLED = 0.5
"""Change of the deviance, -2 log likelihood, in a step; chance puts the estimates off by one for each variance."""

FALLING = 0.9
"""Factors of the differences from which on nothing is told of the limit."""


@dataclass(frozen=True)
class DeformationComponents:
    """Variances theta and redundancies of the components, (n,) float64 each, sizes of the bodies, variance of unit
    weight."""

    variance: Float
    redundancy: Float
    size: Float
    phi: float


def deformation_components(
    S: Float, g: Float, component: Int, body: Int, squares: float, redundancy: int, least: float
) -> DeformationComponents:
    """Estimate the variances.

    Parameters
    ----------
    S : (m, m) float64
        Normal matrix of deformations of unit variance.
    g : (m,) float64
        Their misfit.
    component, body : (m,) int
    squares : float
        Sum of squares of the adjustment, v'Wv.
    redundancy : int
        Of the adjustment.
    least : float
        The smallest that phi may be.
    """
    n, size = int(component.max(initial=-1)) + 1, np.ones(int(body.max(initial=-1)) + 1)
    if not n:
        return DeformationComponents(np.zeros(0), np.zeros(0), size, max(squares / redundancy, least))
    # To begin with each deformation explains its own misfit.
    share = S.diagonal()
    members = np.maximum(np.bincount(component, minlength=n), 1)
    theta: Float = np.bincount(component, (g / share) ** 2, minlength=n) / members
    phi, r, steps = max(squares / redundancy, least), np.zeros(n), [theta]
    deviance = np.inf
    for _ in range(ROUNDS):
        d = np.maximum(theta[component] * size[body], 1e-300)
        root = np.sqrt(d / phi)
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
        local_redundancy, share = 1.0 - np.einsum("ij,ij->j", L_inverse, L_inverse), z**2 / d
        r = np.bincount(component, local_redundancy, minlength=n).astype(np.float64)
        theta = theta * np.bincount(component, share, minlength=n) / np.maximum(r, 1e-12)
        size = size * (np.bincount(body, share) + ESTIMABLE) / (np.bincount(body, local_redundancy) + ESTIMABLE)
        size /= size.mean()
        last, white = deviance, squares - float(z @ g)
        deviance = white / phi + redundancy * float(np.log(phi)) - 2.0 * float(np.log(L_inverse.diagonal()).sum())
        phi = max(white / redundancy, least)
        if abs(last - deviance) < SETTLED:
            break
        steps.append(theta)
        if len(steps) == 3:
            theta = _limit(*steps)
            steps = [theta]
    return DeformationComponents(theta, r, size, phi)


def _limit(first: Float, second: Float, third: Float) -> Float:
    """Where values lead whose logarithms differ by less and less, by a constant factor; the third where they do not."""
    with np.errstate(divide="ignore", invalid="ignore"):
        before, last = np.log(second / first), np.log(third / second)
        factor = last / before
        falling = np.isfinite(factor) & (factor > 0) & (factor < FALLING)
        return np.where(falling, third * np.exp(np.where(falling, last * factor / (1 - factor), 0.0)), third)
