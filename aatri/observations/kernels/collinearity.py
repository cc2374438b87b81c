"""Collinearity, linearised ray by ray: the compiled lane of image points.

The equations are those of `aatri.geometry.collinearity`; results are whitened by independent standard deviations.
"""

from numba import njit

SIGNATURE = (
    "void(int64, int64, int32[::1], int32[::1], float64[:,::1], float64[:,::1], float64[::1], float64[:,::1], "
    "float64[:,:,::1], float64[:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1])"
)


@njit(SIGNATURE, nogil=True, cache=True, error_model="numpy")
def linearise(first, last, image, point, xy, weight, c, X0, R, X, v, by_pose, by_point):
    """Residuals and derivatives of the rays first ... last - 1.

    Parameters
    ----------
    first, last : int
    image, point : (n,) int32
    xy : (n, 2) float64, mm
    weight : (n, 2) float64, 1/mm
        Inverse standard deviations.
    c : (n,) float64, mm
    X0 : (n_images, 3) float64, m
    R : (n_images, 3, 3) float64
    X : (n_points, 3) float64, m
    v : (last - first, 2) float64
    by_pose : (last - first, 2, 6) float64
    by_point : (last - first, 2, 3) float64
        Filled in.
    """
    for k in range(first, last):
        r, i, p = k - first, image[k], point[k]
        dx, dy, dz = X[p, 0] - X0[i, 0], X[p, 1] - X0[i, 1], X[p, 2] - X0[i, 2]
        u0 = R[i, 0, 0] * dx + R[i, 1, 0] * dy + R[i, 2, 0] * dz
        u1 = R[i, 0, 1] * dx + R[i, 1, 1] * dy + R[i, 2, 1] * dz
        u2 = R[i, 0, 2] * dx + R[i, 1, 2] * dy + R[i, 2, 2] * dz
        f = -c[k] / u2
        for e in range(2):
            u = u0 if e == 0 else u1
            w = weight[k, e]
            computed = f * u
            v[r, e] = (computed - xy[k, e]) * w
            a, b = f * w, -computed / u2 * w
            q0 = a * R[i, 0, e] + b * R[i, 0, 2]
            q1 = a * R[i, 1, e] + b * R[i, 1, 2]
            q2 = a * R[i, 2, e] + b * R[i, 2, 2]
            by_point[r, e, 0], by_point[r, e, 1], by_point[r, e, 2] = q0, q1, q2
            by_pose[r, e, 0], by_pose[r, e, 1], by_pose[r, e, 2] = -q0, -q1, -q2
            by_pose[r, e, 3] = q1 * dz - q2 * dy
            by_pose[r, e, 4] = q2 * dx - q0 * dz
            by_pose[r, e, 5] = q0 * dy - q1 * dx


@njit(
    "void(int64, int64, int32[::1], int32[::1], float64[:,::1], float64[:,:,::1], float64[:,::1], boolean[::1])",
    nogil=True,
    cache=True,
)
def in_front(first, last, image, point, X0, R, X, found):
    """Whether the points of the rays first ... last - 1 lie in front of their cameras; written into `found`."""
    for k in range(first, last):
        i, p = image[k], point[k]
        depth = 0.0
        for a in range(3):
            depth += R[i, a, 2] * (X[p, a] - X0[i, a])
        found[k] = depth < 0.0
