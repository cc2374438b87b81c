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
from aatri.formats.results.column_names import angle_sigmas_deg, angles_deg, standard_deviations

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
    images = solution.images
    angles = np.column_stack([*angles_deg(images, SYSTEM).values()])
    of_angles = np.nan_to_num(np.column_stack([*angle_sigmas_deg(images, SYSTEM).values()]))
    of_place = np.nan_to_num(standard_deviations(images.covariance))[:, NORTH_EAST]
    return [
        _line(images.id[row], images.position_m[row][NORTH_EAST], angles[row], of_place[row], of_angles[row])
        for row in np.flatnonzero(images.oriented)
    ]


def _points(solution: Solution) -> list[str]:
    p = solution.points
    sigma = np.nan_to_num(standard_deviations(p.covariance_m2))
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
