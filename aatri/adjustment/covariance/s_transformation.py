"""Free network: covariances of a minimally constrained adjustment carried over to inner constraints.

The observations leave the directions H open (N H = 0, d columns). Let Q_s be the covariance with any d scalars held
that close them, and D the 0/1 diagonal matrix of the datum: the scalars on which the datum rests. With inner
constraints G'dx = 0, G = D H, the covariance is

    Q = P Q_s P',    P = I - H M G',    M = (G'H)^-1          (Baarda's S-transformation)

Of all minimal datums it has the smallest trace over the datum; with D = I it is the pseudo-inverse of N. It does not
depend on what was held: another choice changes Q_s by H times something on either side, and P H = 0. Each block needs
only its own part of Z = Q_s G, d solves for all of them together:

    Q_bb = Q_s,bb - H_b M Z_b' - Z_b M H_b' + H_b M (G'Z) M H_b'

What the observations determine, residuals and redundancy numbers, does not change, since J H = 0. The gains Q J'
become K_b - H_b M (J Z)'.

Source: Baarda 1973, S-transformations and criterion matrices; docs/formulas.md 6.6.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.covariance.constrained import covariance_reduction, covariance_times
from aatri.adjustment.covariance.gains import Gains
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.records import CHUNK, Records, predicted, times
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float


@dataclass(frozen=True)
class STransformation:
    """The way from a minimally constrained adjustment to inner constraints."""

    H: Mapping[str, Float]
    Z: Mapping[str, Float]
    """Mapping of (n, k, d). Open directions, and Q_s G, by group."""
    M: Float
    inner: Float
    """(d, d). (G'H)^-1, and M G'Z M."""

    def covariances(self, groups: Mapping[str, Float]) -> dict[str, Float]:
        """Covariances of all blocks, from those of the minimally constrained adjustment."""
        transformed = dict(groups)
        for group, h in self.H.items():
            mixed = h @ self.M @ self.Z[group].swapaxes(1, 2)
            transformed[group] = groups[group] - mixed - mixed.swapaxes(1, 2) + h @ self.inner @ h.swapaxes(1, 2)
        return transformed

    def move_gains(self, gains: Gains, records: Records, state: State) -> None:
        """Carry the gains of all records of a type over, in place."""
        for first in range(0, len(records.active), CHUNK):
            rows = np.arange(first, min(first + CHUNK, len(records.active)))
            T = times(records, rows, predicted(records, state, rows)[1], self.Z)
            for (group, block), gain in zip(records.touches, gains.gain):
                if gain is not None and group in self.H:
                    gain[rows] -= self.H[group][block[rows]] @ self.M @ T.swapaxes(1, 2)


def s_transformation(
    problem: IndexedProblem, state: State, H: Mapping[str, Float], datum: Mapping[str, Bool]
) -> STransformation:
    """What takes covariances to inner constraints.

    Parameters
    ----------
    problem : IndexedProblem
        With d scalars held that close the open directions.
    H : mapping of (n, k, d) float64
        Open directions by group; groups that are missing are zero.
    datum : mapping of (n, k) bool
        Scalars on which the datum rests.
    """
    G = {group: h * datum[group][:, :, None] for group, h in H.items() if group in datum}
    factored = factorise(problem, state)
    W = covariance_reduction(problem, factored, state)
    Z = covariance_times(problem, factored, state, W, G)
    M = np.linalg.inv(sum(np.einsum("nki,nkj->ij", g, H[group]) for group, g in G.items()))
    inner = M @ sum(np.einsum("nki,nkj->ij", g, Z[group]) for group, g in G.items()) @ M
    return STransformation(H, Z, M, inner)
