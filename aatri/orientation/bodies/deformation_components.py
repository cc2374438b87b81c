"""Variance components of deformations that an adjustment did not have, from its residuals.

The misfit g of deformations z and of nuisances n to the residuals has the covariance phi N + N D N, N their normal
matrix, phi the variance of unit weight. Nuisances may be anything: what the adjustment estimated, whose misfit is
none, and what else is not to count. D is diagonal: the variance of a deformation is that of its component times the
size of its body, d = theta lambda. With the most probable values and the redundancies

    (n, z) = M^-1 g / phi,      M = N / phi + 1 / D,      r = 1 - diag(M^-1) / D,

1 / D of a nuisance all but 0, the estimate is, over all deformations of a component and then of a body,

    theta = theta sum z^2 / d / sum r,      lambda = lambda (sum z^2 / d + e) / (sum r + e),      mean of lambda 1,

repeated until nothing changes: Foerstner's. Bodies of one component are much alike, but a strip whose points lie on one
side of it errs by twice as much as others: lambda is told by some ten redundancies each, and begins as if e =
`ESTIMABLE_REDUNDANCY` of them had told that it is 1. After every two steps the rest is taken to fall on as they did
(Aitken). With y'y the sum of squares of the adjustment and f the redundancy beside the nuisances phi = (y'y - (n, z)'g)
/ f, by maximum likelihood of the residuals, whose deviance is (y'y - (n, z)'g) / phi + f log phi + log |1 + N D / phi|:
where it settles all is done, as components that do much the same creep towards each other for long.

N has entries for bodies that meet alone, so that the cost is proportional to their number.

Source: Foerstner 1979, as adjustment.statistics.variance_components; Harville 1977 (phi).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from aatri.adjustment.elimination.block_matrix import block_matrix
from aatri.adjustment.statistics.limits import ESTIMABLE_REDUNDANCY
from aatri.arrays import Float, Int

ROUNDS = 100
SETTLED = 0.5
"""Change of the deviance, -2 log likelihood, in a step; chance puts the estimates off by one for each variance."""

FALLING = 0.9
"""Factors of the differences from which on nothing is told of the limit."""

LOOSE = 1e-8
"""1 / D of a nuisance, of its own element of N: one that does what others do is held by it. Rounding leaves 1e-16."""


@dataclass(frozen=True)
class DeformationComponents:
    """Variances theta and redundancies of the components, (n,) float64 each, sizes of the bodies, variance of unit
    weight."""

    variance: Float
    redundancy: Float
    size: Float
    phi: float


def deformation_components(
    N: csr_array,
    g: Float,
    component: Int,
    body: Int,
    squares: float,
    redundancy: int,
    least: float,
    position: Float | None = None,
) -> DeformationComponents:
    """Estimate the variances.

    Parameters
    ----------
    N : (m, m) csr_array
        Normal matrix of deformations of unit variance and of nuisances.
    g : (m,) float64
        Their misfit.
    component, body : (m,) int
        -1 is the component of nuisances. Bodies ascend.
    squares : float
        Sum of squares of the adjustment, v'Wv.
    redundancy : int
        Of the adjustment, had it estimated no nuisance.
    least : float
        The smallest that phi may be.
    position : (n_bodies, d) float64, optional
        Of the bodies, by which they are eliminated.
    """
    n, n_bodies = (
        int(component.max(initial=-1)) + 1,
        int(body.max(initial=-1)) + 1 if position is None else len(position),
    )
    size = np.ones(n_bodies)
    if not n:
        return DeformationComponents(np.zeros(0), np.zeros(0), size, max(squares / redundancy, least))
    position = np.arange(n_bodies, dtype=np.float64)[:, None] if position is None else position
    matrix, (z, nuisance) = block_matrix(N, body, position), (component >= 0, component < 0)
    component, body, share = component[z], body[z], N.diagonal()
    scale, added = 1.0 / np.sqrt(np.maximum(share, 1e-300)), np.where(z, 1.0, LOOSE)
    # To begin with each deformation explains its own misfit.
    members = np.maximum(np.bincount(component, minlength=n), 1)
    theta: Float = np.bincount(component, (g * scale**2)[z] ** 2, minlength=n) / members
    phi, r, steps = max(squares / redundancy, least), np.zeros(n), [theta]
    deviance, clipped = np.inf, False
    for _ in range(ROUNDS):
        d = np.maximum(theta[component] * size[body], 1e-300)
        scale[z] = np.sqrt(d / phi)
        factor = matrix.factor(scale, added)
        if factor is None and not clipped:  # of points at infinity N is a difference of large numbers, and not definite
            values, vectors = np.linalg.eigh(N.toarray())
            N, clipped = csr_array((vectors * np.maximum(values, 0.0)) @ vectors.T), True
            matrix = block_matrix(N, np.zeros(len(z), dtype=np.int64), np.zeros((1, 1)))
            scale = 1.0 / np.sqrt(np.maximum(N.diagonal(), 1e-300))
            continue
        if factor is None:
            break
        most_probable = scale * factor.solve(scale * g)
        local_redundancy, share = 1.0 - added * factor.inverse_diagonal(), most_probable[z] ** 2 / d
        beside, local_redundancy = max(redundancy - local_redundancy[nuisance].sum(), 1.0), local_redundancy[z]
        r = np.bincount(component, local_redundancy, minlength=n).astype(np.float64)
        theta = theta * np.bincount(component, share, minlength=n) / np.maximum(r, 1e-12)
        of_bodies = [np.bincount(body, x, minlength=n_bodies) + ESTIMABLE_REDUNDANCY for x in (share, local_redundancy)]
        size = size * of_bodies[0] / of_bodies[1]
        size /= size.mean()
        last, white = deviance, squares - float(most_probable @ g)
        deviance = white / phi + beside * float(np.log(phi)) + factor.log_determinant
        phi = max(white / beside, least)
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
