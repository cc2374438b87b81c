"""Which of several bodies control and their common points determine together.

A body k moves a place X on the ground by G(X) z_k: shift, rotation, change of scale. Of a control point its given
coordinates are seen, of a point of two bodies the difference,

    dX = G(X) z_k,        dX_k - dX_l = G(X) z_k - G(X) z_l

each by its amount; bodies that are placed do not move. With N = J'J of all rows J and M_k the mean of G'G over the
points of body k, N z = lambda M z compares what a motion moves with what is seen of it, as in `datum_analysis` of a
single body: motions with lambda below `UNDETERMINED_MOTION` are open. The body that moves most by them is left out, and
what remains is asked again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigh

from aatri.arrays import Bool, Float, Int
from aatri.geometry.similarity import motions
from aatri.orientation.bodies.limits import UNDETERMINED_MOTION

RIDGE = 1e-9
"""Added to M, as a share of its mean diagonal: a body of few points may have motions that move none of them."""


@dataclass(frozen=True)
class PlacedBody:
    """A body where it lies on the ground, about."""

    point: Int
    """(n,)."""
    xyz_m: Float
    """(n, 3), m."""


def undetermined_bodies(
    bodies: Mapping[int, PlacedBody], movable: Sequence[int], control: Int, has_coordinate: Bool
) -> tuple[int, ...]:
    """Find the bodies of which something stays open.

    Parameters
    ----------
    movable : sequence of int
        Those to be determined together; the others are where they are.
    control : (c,) int
        Points that are control.
    has_coordinate : (c, 3) bool
        Their given coordinates.

    Returns
    -------
    tuple of int
        Those of `movable` to be left out, the one that moves most first.
    """
    left, out = list(movable), list[int]()
    centre = np.mean([bodies[k].xyz_m.mean(axis=0) for k in bodies], axis=0)
    extent = float(np.max([np.ptp(bodies[k].xyz_m, axis=0).max() for k in bodies]))
    at = {k: dict(zip(b.point.tolist(), motions((b.xyz_m - centre) / extent))) for k, b in bodies.items()}
    while left:
        rows = [
            _row({k: at[k][p][axes]}, left)
            for p, axes in zip(control.tolist(), has_coordinate)
            for k in left
            if p in at[k]
        ]
        pairs = [(k, other) for k in left for other in at if other not in out and not (other in left and other <= k)]
        for k, other in pairs:
            common = at[k].keys() & at[other].keys()
            rows += [_row({k: at[k][p], other: -at[other][p]}, left) for p in sorted(common)]
        J = np.concatenate([np.zeros((1, 7 * len(left))), *rows])
        M = block_diag(*(np.mean([G.T @ G for G in at[k].values()], axis=0) for k in left))
        values, z = eigh(J.T @ J, M + RIDGE * np.trace(M) / len(M) * np.eye(len(M)))
        open_z = z[:, values < UNDETERMINED_MOTION].reshape(len(left), 7, -1)
        if not open_z.size:
            break
        moved = [float((np.stack([*at[k].values()]) @ z_k).std()) for k, z_k in zip(left, open_z)]
        out.append(left.pop(int(np.argmax(moved))))
    return tuple(out)


def _row(seen: Mapping[int, Float], movable: Sequence[int]) -> Float:
    """Rows (m, 7 k) of what is seen of the motions of bodies; those that do not move have no columns."""
    m = len(next(iter(seen.values())))
    return np.concatenate([seen.get(k, np.zeros((m, 7))) for k in movable], axis=1)
