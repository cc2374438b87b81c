"""The physical forward model: from a ground point to where its image lies.

    u = R' (X - X0)                          camera frame, looking along -z
    x = -c u_x / u_z,  y = -c u_y / u_z      ideal image coordinates, from the principal point
    q - K (q + q^3 / c^2) = |x|              refraction: q is the radius the ray really has, further out
    m + correction(m) = q                    lens: m is what lands on the image, correction that of the calibration
    photo = m + principal point

K = [2410 H / (H^2 - 6 H + 250) - 2410 h / (h^2 - 6 h + 250) h/H] 1e-6 rad (ARDC 1959, docs/formulas.md 2.3), H and h
the heights of station and terrain above sea level in km. `radial` displaces along the image radius, as the usual
correction assumes; `vertical_plane` displaces each ray in the vertical plane through it, the same equation holding
for the tangent of its nadir angle: t - K (t + t^3) = t_ideal.

Lens (x, y from the principal point, r from the symmetry point):
brown, dx = x (k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 x^2) + 2 p2 x y + b1 x + b2 y,
       dy = y (k1 r^2 + k2 r^4 + k3 r^6) + p2 (r^2 + 2 y^2) + 2 p1 x y;
table, outwards by the tabulated correction, linear between the radii and constant outside them.

Both implicit equations are solved by fixed-point iteration to the last bits, so that the corrections, applied in the
opposite order, invert them to 1e-12 mm. Nothing here is shared with the correction code.
"""

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.simulation.settings import CameraOptions, refused

MOST_ITERATIONS = 100


def camera_frame(X_m: Float, X0_m: Float, ground_from_image: Float) -> Float:
    """u = R' (X - X0), row by row.

    Parameters
    ----------
    X_m, X0_m : (n, 3) float64, m, one Cartesian frame
    ground_from_image : (n, 3, 3) float64
    """
    return np.asarray(np.einsum("nji,nj->ni", ground_from_image, X_m - X0_m))


def ideal(u_m: Float, principal_distance_mm: float) -> Float:
    """Central projection of camera-frame vectors: (n, 2), mm, from the principal point."""
    return -principal_distance_mm * u_m[:, :2] / u_m[:, 2:]


def refraction_constant_rad(station_km: Float, terrain_km: float) -> Float:
    """K of the ARDC 1959 atmosphere for heights above sea level."""
    H, h = station_km, terrain_km
    return 1e-6 * (2410 * H / (H * H - 6 * H + 250) - 2410 * h / (h * h - 6 * h + 250) * (h / H))


def refracted_radially(ideal_mm: Float, K_rad: Float, principal_distance_mm: float) -> Float:
    """Coordinates displaced outwards along the image radius: (n, 2), mm."""
    r = np.hypot(ideal_mm[:, 0], ideal_mm[:, 1])
    q = _solved(lambda q: r + K_rad * (q + q**3 / principal_distance_mm**2), r)
    return ideal_mm * np.divide(q, r, out=np.ones_like(r), where=r > 0)[:, None]


def refracted_in_vertical_plane(d_m: Float, K_rad: Float) -> Float:
    """Direction in which a ray arrives, bent in the vertical plane through it.

    Parameters
    ----------
    d_m : (n, 3) float64, m, from the station to the point in the axes of the station (east, north, up)
    """
    t = np.hypot(d_m[:, 0], d_m[:, 1]) / -d_m[:, 2]
    apparent = _solved(lambda q: t + K_rad * (q + q**3), t)
    stretch = np.divide(apparent, t, out=np.ones_like(t), where=t > 0)
    return np.column_stack([d_m[:, :2] * stretch[:, None], d_m[:, 2]])


def through_lens(refracted_mm: Float, camera: CameraOptions) -> Float:
    """Where rays land on the image: m with m + correction(m) = given; (n, 2), mm, from the principal point."""
    if camera.distortion == "none":
        return refracted_mm
    correction = _brown if camera.distortion == "brown" else _tabulated
    return _solved(lambda m: refracted_mm - correction(m, camera), refracted_mm)


def _brown(m_mm: Float, camera: CameraOptions) -> Float:
    k1, k2, k3, p1, p2, b1, b2 = camera.brown_parameters()
    x, y = m_mm.T
    from_symmetry = m_mm - camera.symmetry_point_mm
    rr = from_symmetry[:, 0] ** 2 + from_symmetry[:, 1] ** 2
    radial = rr * (k1 + rr * (k2 + rr * k3))
    dx = x * radial + p1 * (rr + 2 * x * x) + 2 * p2 * x * y + b1 * x + b2 * y
    dy = y * radial + p2 * (rr + 2 * y * y) + 2 * p1 * x * y
    return np.stack([dx, dy], axis=1)


def _tabulated(m_mm: Float, camera: CameraOptions) -> Float:
    out = m_mm - camera.symmetry_point_mm
    r = np.hypot(out[:, 0], out[:, 1])
    outwards = np.interp(r, camera.table_radius_mm, 1e-3 * np.asarray(camera.table_correction_um))
    return out * np.divide(outwards, r, out=np.zeros_like(r), where=r > 0)[:, None]


def _solved(step: Callable[[Float], Float], start: Float) -> Float:
    """Fixed point of `step`, to four units in the last place of the largest value."""
    value, size = start, np.abs(start).max(initial=0.0)
    for _ in range(MOST_ITERATIONS):
        following = step(value)
        change = np.abs(following - value).max(initial=0.0)
        value = following
        if change <= 4 * np.finfo(float).eps * size:
            return value
        if not change <= size:
            break
    raise refused(
        "the distortion or refraction is so strong that the image of some point is not unique",
        "make the distortion parameters smaller; at the corner they should move a point by a few percent",
        InputError,
    )
