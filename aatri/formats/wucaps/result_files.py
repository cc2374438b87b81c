"""Results in files beside those of WuCAPS, in their style: lines of words, `-99` ends a list, X north and Y east.

The layout of its own results is not published; these hold what its menu shows after an adjustment.

    RESORI  photo X Y H phi omega kappa sX sY sH s_phi s_omega s_kappa      m, degrees
    RESPNT  point X Y H sX sY sH rays                                       m
    RESVPT  photo n, then n lines point vx vy                               um, adjusted minus measured
    RESVGC  point vX vY vH                                                  m, control: adjusted minus given
"""

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.solution import Solution
from aatri.geometry.rotations import angle_covariance, angles_from_rotation

SYSTEM = "phi-omega-kappa"
NORTH_EAST = [1, 0, 2]
END = "-99"


def result_lines(solution: Solution) -> dict[str, list[str]]:
    """Lines of each file, by name; what is not determined is 0 with a standard deviation of 0."""
    return {
        "RESORI": [*_orientations(solution), END],
        "RESPNT": [*_points(solution), END],
        "RESVPT": [*_image_residuals(solution), END],
        "RESVGC": [*_control_residuals(solution), END],
    }


def _orientations(solution: Solution) -> list[str]:
    images, lines = solution.images, list[str]()
    rows = np.flatnonzero(images.oriented)
    R, C = images.ground_from_image[rows], images.covariance[rows]
    angles = np.degrees(angles_from_rotation(R, SYSTEM)) if len(rows) else np.zeros((0, 3))
    turned = np.nan_to_num(C[:, 3:, 3:])
    sigma = np.degrees(np.sqrt(np.einsum("nii->ni", angle_covariance(R, turned, SYSTEM)))) if len(rows) else angles
    of_place = np.sqrt(np.einsum("nii->ni", np.nan_to_num(C[:, :3, :3])))
    for k, row in enumerate(rows):
        place, s = images.position_m[row][NORTH_EAST], of_place[k][NORTH_EAST]
        lines.append(_line(images.id[row], place, angles[k], s, sigma[k]))
    return lines


def _points(solution: Solution) -> list[str]:
    p = solution.points
    sigma = np.sqrt(np.nan_to_num(np.einsum("nii->ni", p.covariance_m2)))
    rows = np.flatnonzero(np.isfinite(p.xyz_m).all(axis=1))
    return [f"{_line(p.id[row], p.xyz_m[row][NORTH_EAST], sigma[row][NORTH_EAST])} {p.rays[row]}" for row in rows]


def _image_residuals(solution: Solution) -> list[str]:
    r, lines = solution.residuals, list[str]()
    rows = r.used("image_point")
    for image in dict.fromkeys(r.image[rows].tolist()):
        of_image = rows[r.image[rows] == image]
        lines.append(f"{image} {len(of_image)}")
        lines += [_line(r.point[row], 1e3 * r.residual[row, :2]) for row in of_image]
    return lines


def _control_residuals(solution: Solution) -> list[str]:
    r = solution.residuals
    rows = r.used("control")
    return [_line(r.point[row], np.nan_to_num(r.residual[row])[NORTH_EAST]) for row in rows]


def _line(name: str, *values: Float) -> str:
    return " ".join([str(name), *(repr(float(v)) for row in values for v in row)])
