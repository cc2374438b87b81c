"""Rays of cameras with models of their own: into the axes of the camera, and back out.

The camera model stands between two kernels: u = R'(X - X0) before it, and the chain rule after it. Those that are
compiled too are in `camera_models`.
"""

from numba import njit

SCENE = "int32[::1], int32[::1], float64[:,::1], float64[:,:,::1], float64[:,::1]"


@njit(f"void(int64, int64, {SCENE}, float64[:,::1])", nogil=True, cache=True, error_model="numpy")
def into_camera(first, last, image, point, X0, R, X, u):
    """Ground points of the rays first ... last - 1 in the axes of their images, u (last - first, 3)."""
    for k in range(first, last):
        r, i, p = k - first, image[k], point[k]
        dx, dy, dz = X[p, 0] - X0[i, 0], X[p, 1] - X0[i, 1], X[p, 2] - X0[i, 2]
        for a in range(3):
            u[r, a] = R[i, 0, a] * dx + R[i, 1, a] * dy + R[i, 2, a] * dz


@njit(
    f"void(int64, int64, {SCENE}, float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[:,:,::1])",
    nogil=True,
    cache=True,
)
def out_of_camera(first, last, image, point, X0, R, X, weight, by_u, by_pose, by_point):
    """Derivatives to pose (X0, d; R <- exp([d]x) R) and point, whitened, from those to u.

    Parameters
    ----------
    weight : (n, 2) float64, 1/mm
    by_u : (last - first, 2, 3) float64, mm
    by_pose : (last - first, 2, 6) float64
    by_point : (last - first, 2, 3) float64
        Filled in.
    """
    for k in range(first, last):
        r, i, p = k - first, image[k], point[k]
        dx, dy, dz = X[p, 0] - X0[i, 0], X[p, 1] - X0[i, 1], X[p, 2] - X0[i, 2]
        for e in range(2):
            w = weight[k, e]
            a, b, c = w * by_u[r, e, 0], w * by_u[r, e, 1], w * by_u[r, e, 2]
            q0 = a * R[i, 0, 0] + b * R[i, 0, 1] + c * R[i, 0, 2]
            q1 = a * R[i, 1, 0] + b * R[i, 1, 1] + c * R[i, 1, 2]
            q2 = a * R[i, 2, 0] + b * R[i, 2, 1] + c * R[i, 2, 2]
            by_point[r, e, 0], by_point[r, e, 1], by_point[r, e, 2] = q0, q1, q2
            by_pose[r, e, 0], by_pose[r, e, 1], by_pose[r, e, 2] = -q0, -q1, -q2
            by_pose[r, e, 3] = q1 * dz - q2 * dy
            by_pose[r, e, 4] = q2 * dx - q0 * dz
            by_pose[r, e, 5] = q0 * dy - q1 * dx
