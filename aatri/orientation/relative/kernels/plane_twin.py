"""The other orientation that explains points of a plane, compiled.

Points of the plane m'X = 1 in the frame of the left image map to the right one by H = R'A, A = I - b m'. With
v = |b|^2 m - 2 b

    A'A = I + (m v' + v m') / 2

is the same for m and v exchanged: m2 = v, b2 = (s m2 - m) / 2, where s = |b2|^2 is a root of

    s^2 |v|^2 - (2 v.m + 4) s + |m|^2 = 0,    that with det A2 = det A,    and R2' = R'A A2^-1.

m follows from the inverse lengths q of the rays, m'u = q, which are linear in it and equally certain.

`pose` and `rays` are those of `sampson`. Source: Longuet-Higgins, Proc. R. Soc. B 227 (1986) 399.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS, inverse_root, newton_step


@njit("boolean(float64[:,::1], float64[:,::1], boolean[::1], float64[::1])", **OPTIONS)
def plane_of(pose, rays, use, m):
    """Fill m of the plane m'X = 1 that is nearest to the chosen points; False if they determine none."""
    N, W, g, w = np.zeros((3, 3)), np.empty((3, 3)), np.zeros(3), np.empty(3)
    for n in range(len(rays)):
        if not use[n]:
            continue
        square, l1 = 0.0, 0.0
        for i in range(3):
            w[i] = pose[i, 0] * rays[n, 3] + pose[i, 1] * rays[n, 4] + pose[i, 2] * rays[n, 5]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            c = rays[n, j] * w[k] - rays[n, k] * w[j]
            square += c * c
            l1 += (pose[j, 3] * w[k] - pose[k, 3] * w[j]) * c
        if not l1 > 0.0:
            continue
        for i in range(3):
            g[i] -= rays[n, i] * square / l1
            for j in range(i + 1):
                N[i, j] += rays[n, i] * rays[n, j]
    if not inverse_root(N, W) > 1e-10:
        return False
    newton_step(W, g, m)
    return True


@njit("boolean(float64[:,::1], float64[::1], float64[:,::1])", **OPTIONS)
def twin(pose, m, other):
    """Fill in the other orientation over the plane m, its base of length 1; False if there is none."""
    v, A, A2, b2 = np.empty(3), np.eye(3), np.eye(3), np.empty(3)
    vv, vm, mm, bm = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        v[i] = m[i] - 2.0 * pose[i, 3]
        vv, vm, mm, bm = vv + v[i] * v[i], vm + v[i] * m[i], mm + m[i] * m[i], bm + pose[i, 3] * m[i]
        for j in range(3):
            A[i, j] -= pose[i, 3] * m[j]
    half = vm + 2.0
    root = half * half - vv * mm
    if not (root >= 0.0 and vv > 0.0):
        return False
    best = np.inf
    for sign in range(2):
        s = (half + (np.sqrt(root) if sign == 0 else -np.sqrt(root))) / vv
        off = abs(0.5 * (s * vv - vm) - bm)  # det A = 1 - b.m
        if off < best:
            best = off
            for i in range(3):
                b2[i] = 0.5 * (s * v[i] - m[i])
    length = np.sqrt(b2[0] ** 2 + b2[1] ** 2 + b2[2] ** 2)
    if not (length > 0.0 and best < 1e-6 * (1.0 + abs(bm))):
        return False
    b2v = b2[0] * v[0] + b2[1] * v[1] + b2[2] * v[2]
    if not abs(1.0 - b2v) > 1e-9:
        return False
    for i in range(3):  # A2^-1 = I + b2 m2' / (1 - b2.m2)
        for j in range(3):
            A2[i, j] += b2[i] * v[j] / (1.0 - b2v)
    # R2' = R'A A2^-1, so R2 = (A A2^-1)' R
    for i in range(3):
        for j in range(3):
            entry = 0.0
            for k in range(3):
                turned = 0.0
                for q in range(3):
                    turned += A[k, q] * A2[q, i]
                entry += turned * pose[k, j]
            other[i, j] = entry
        other[i, 3] = b2[i] / length
    return True
