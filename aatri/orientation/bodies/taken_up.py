"""What of the deformation of strips the similarities have taken up by which they were brought to the ground.

Strips were joined to each other by similarities from their common points, and then went to the ground together, by one
similarity from control. A deformation z of the strips was in both, so that they err by what they took up of it,

    s = -(S'N_t S)^+ S'N_t Z z,        t = -(M'N M)^-1 M'N (Z z + S s),        s + M t

with S the similarities of the strips, M the motions of all strips of a component together, which common points leave
open, N_t and N the normal matrices of common points alone and of all. Where there is no control positions have
brought the strips to the ground: M is then fitted to all of their points.

Source: error propagation of the two adjustments of absolute orientation (docs/methods/absolute_orientation.md).
"""

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from aatri.arrays import Float, Int
from aatri.geometry.strip_bases import StripAxes
from aatri.orientation.bodies.limits import WEAK_TIE

SIZE = 7
"""Unknowns of a similarity: three shifts, scale, azimuth, two tilts, all in m at the edges of a strip."""


def similarities(axes: Sequence[StripAxes], functions: int, across: int) -> Float:
    """Similarities of strips by the functions 1, u, v in U, V and W, (n_strips, 3 m, 7).

    Parameters
    ----------
    axes : (n_strips,) sequence of StripAxes
    functions : int
        How many there are, m.
    across : int
        Which is v; 1 and u are the first two.
    """
    half = np.stack([a.half_range_m for a in axes])
    narrow = half[:, 1] / half[:, 0]
    S = np.zeros((len(axes), 3, functions, SIZE))
    S[:, range(3), 0, range(3)] = 1.0
    S[:, 0, 1, 3], S[:, 1, across, 3] = 1.0, narrow
    S[:, 1, 1, 4], S[:, 0, across, 4] = 1.0, -narrow
    S[:, 2, 1, 5] = S[:, 2, across, 6] = 1.0
    return S.reshape(len(axes), 3 * functions, SIZE)


def motions(axes: Sequence[StripAxes], component: Int) -> Float:
    """Motions of all strips of a component together, by the similarities of each, (7 n_strips, 7 n_components).

    Parameters
    ----------
    axes : (n_strips,) sequence of StripAxes
    component : (n_strips,) int
    """
    n, largest = len(axes), max(float(a.half_range_m.max()) for a in axes)
    origin = np.stack([a.origin_m for a in axes])
    moved = np.zeros((n, SIZE, int(component.max()) + 1, SIZE))
    for j, k in enumerate(component.tolist()):
        R, (along, across), M = axes[j].ground_from_axes, axes[j].half_range_m / largest, moved[j, :, k]
        x, y = (origin[j] - origin[component == k].mean(axis=0))[:2] / largest
        M[:3, :3] = R.T
        M[:2, 3], M[3, 3] = (x, y) @ R[:2, :2], along
        M[:2, 4], M[4, 4] = (-y, x) @ R[:2, :2], along
        M[2, 5:], M[5, 5:], M[6, 5:] = (x, y), R[:2, 0] * along, R[:2, 1] * across
    return moved.reshape(n * SIZE, -1)


def taken_up(N_ties: csr_array, N: csr_array, s: Int, z: Int, axes: Sequence[StripAxes]) -> Float:
    """What the similarities err by for deformations of one each, (7 n_strips, n_z).

    Parameters
    ----------
    N_ties, N : (n, n) csr_array
        Normal matrices of common points and of all.
    s, z : (7 n_strips,), (n_z,) int
        Rows of the similarities in them, strip by strip, and of the deformations.
    axes : (n_strips,) sequence of StripAxes
    """
    M, n = N_ties[s][:, s].toarray(), len(axes)
    tied = np.abs(M).reshape(n, SIZE, n, SIZE).max(axis=(1, 3)) > 0
    least = M.diagonal().mean() or 1.0  # 1: no strip has a point in common with another
    scale = np.sqrt(np.where(M.diagonal() > 0, M.diagonal(), least))
    together = np.linalg.qr(motions(axes, connected_components(tied)[1]) * scale[:, None])[0]
    w, V = np.linalg.eigh(M / np.outer(scale, scale) + together @ together.T)
    strong, V = w > WEAK_TIE, V / scale[:, None]
    err = -(V[:, strong] / w[strong]) @ (N_ties[z][:, s] @ V[:, strong]).T
    moved = np.concatenate([together / scale[:, None], V[:, ~strong]], axis=1)
    of_similarities, of_deformations = N[s][:, s] @ moved, N[z][:, s] @ moved
    t = np.linalg.pinv(moved.T @ of_similarities, hermitian=True) @ (of_deformations.T + of_similarities.T @ err)
    return np.asarray(err - moved @ t)
