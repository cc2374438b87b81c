"""The corrections that undo the forward model, written here on their own (docs/formulas.md 2.3, 2.4, 2.5)."""

import numpy as np

EARTH_RADIUS_M = 6_371_000.0


def photo_from_block(block):
    """Photo coordinates by an affine transformation of the measured fiducials, or from pixels."""
    xy = block.image_points.xy.copy()
    if block.cameras.kind[0] == "digital":
        size, (columns, rows) = block.cameras.pixel_size_mm[0], block.cameras.format[0]
        return np.stack([(xy[:, 0] - columns / 2) * size[0], (rows / 2 - xy[:, 1]) * size[1]], axis=1)
    for image in range(len(block.images)):
        marks = block.fiducial_points.image == image
        measured = block.fiducial_points.xy[marks]
        calibrated = block.fiducials.xy_mm[block.fiducial_points.fiducial[marks]]
        origin = measured.mean(axis=0)
        design = np.column_stack([measured - origin, np.ones(len(measured))])
        parameters = np.linalg.lstsq(design, calibrated, rcond=None)[0]
        rows = block.image_points.image == image
        xy[rows] = np.column_stack([xy[rows] - origin, np.ones(rows.sum())]) @ parameters
    return xy


def lens_corrected(photo, block):
    """Principal point subtracted, then the correction of the calibration added."""
    xy = photo - block.cameras.principal_point_mm[0]
    bar = xy - block.cameras.symmetry_point_mm[0]
    r2 = (bar**2).sum(axis=1)
    if block.cameras.distortion[0] == "brown":
        k = dict(zip(block.camera_parameters.name.tolist(), block.camera_parameters.value.tolist()))
        k = {name: k.get(name, 0.0) for name in ("k1", "k2", "k3", "p1", "p2", "b1", "b2")}
        radial = k["k1"] * r2 + k["k2"] * r2**2 + k["k3"] * r2**3
        x, y = xy.T
        dx = x * radial + k["p1"] * (r2 + 2 * x**2) + 2 * k["p2"] * x * y + k["b1"] * x + k["b2"] * y
        dy = y * radial + k["p2"] * (r2 + 2 * y**2) + 2 * k["p1"] * x * y
        return xy + np.stack([dx, dy], axis=1)
    if block.cameras.distortion[0] == "table":
        r = np.sqrt(r2)
        outwards = np.interp(r, block.distortion_table.radius_mm, block.distortion_table.correction_mm)
        return xy + bar * (outwards / r)[:, None]
    return xy


def refraction_corrected(xy, c, station_height_m, terrain_height_m):
    """r = r - K (r + r^3 / c^2)."""
    H, h = station_height_m / 1000, terrain_height_m / 1000
    K = (2410 * H / (H**2 - 6 * H + 250) - 2410 * h / (h**2 - 6 * h + 250) * (h / H)) * 1e-6
    r2 = (xy**2).sum(axis=1)
    return xy * (1 - K * (1 + r2 / c**2))[:, None]


def curvature_corrected(xy, c, height_above_ground_m):
    """r = r + H' r^3 / (2 R c^2)."""
    r2 = (xy**2).sum(axis=1)
    return xy * (1 + height_above_ground_m * r2 / (2 * EARTH_RADIUS_M * c**2))[:, None]


def projected(block):
    """Collinearity of the true points and stations, in the frame of the block."""
    i, p = block.image_points.image, block.image_points.point
    d = block.true_points.xyz_m[p] - block.true_images.position_m[i]
    u = (block.true_images.ground_from_image[i] * d[:, :, None]).sum(axis=1)
    return -block.cameras.principal_distance_mm[0] * u[:, :2] / u[:, 2:]


def station_heights(block):
    """Height above sea level of every station, m."""
    X = block.true_images.position_m
    if block.frames.id[0] == "tangent":
        return np.sqrt(X[:, 0] ** 2 + X[:, 1] ** 2 + (EARTH_RADIUS_M + X[:, 2]) ** 2) - EARTH_RADIUS_M
    return X[:, 2]
