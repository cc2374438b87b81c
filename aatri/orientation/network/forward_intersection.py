"""Control points by forward intersection from two stations, their accuracy, and the scale of the net from a bar.

Plan, A and B the stations, alpha and beta the angles at them between the base and P, gamma = 180 - alpha - beta at P:

    P = A + [cot(alpha) b + s b_left] / (cot(alpha) + cot(beta)),    b = B - A,  b_left = (-b_y, b_x)

s = 1 where P lies to the left of A -> B (x right, y up), else -1. With A (0, 0) and the base along y this is
X = S / (cot a + cot b), Y = S cot a / (cot a + cot b). Heights (v vertical angles, d horizontal distances, i and t
heights of instrument and target), the mean of both stations:

    Z = 1/2 [(Z_A + i_A + d_A tan v_A - t) + (Z_B + i_B + d_B tan v_B - t)]

Accuracy, m_a of the angles, m_A and m_B of the stations (per coordinate of each, in plan), m_ZA, m_ZB of their heights:

    M_P^2 = m_a^2 (d_A^2 + d_B^2) / sin^2 gamma + 2 (d_B m_A / S)^2 + 2 (d_A m_B / S)^2
    M_Z^2 = 1/4 [m_ZA^2 + m_ZB^2 + (d_A m_v / cos^2 v_A)^2 + (d_B m_v / cos^2 v_B)^2 + (tan v_A, tan v_B) C_d (...)']

with M_P^2 = M_X^2 + M_Y^2. The notes write m_A for the point error, sqrt(2) times that per coordinate. C_d, of the two
distances, follows from the angles and stations; the notes take the distances as free of error.

Source: lecture notes on close range of Wuhan University, 5-2-1 to 5-2-11, with the sign s made explicit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class IntersectedPoint:
    """A point from two stations.

    Attributes
    ----------
    xyz_m : (3,) float64, m
    covariance_m2 : (3, 3) float64, m^2
    """

    xyz_m: Float
    covariance_m2: Float

    @property
    def plan_m(self) -> float:
        """Point error in plan, M_P = sqrt(M_X^2 + M_Y^2), m."""
        return float(np.sqrt(np.trace(self.covariance_m2[:2, :2])))

    @property
    def height_m(self) -> float:
        """Standard deviation of the height, m."""
        return float(np.sqrt(self.covariance_m2[2, 2]))


def intersect(A_m: Array, B_m: Array, angles_rad: Array, target_height_m: float = 0.0, left: bool = True) -> Array:
    """Place of a point seen from two stations.

    Parameters
    ----------
    A_m, B_m : (3,) float64, m
        Stations: of the axes of the instruments, so with their heights above the marks.
    angles_rad : (4,) float64, rad
        alpha and beta in the horizon, v_A and v_B above it.
    target_height_m : float, m
    left : bool
        Whether the point is to the left of A -> B.

    Returns
    -------
    (3,) float64, m
    """
    alpha, beta, v_A, v_B = angles_rad
    b = B_m[:2] - A_m[:2]
    cot_a, cot_b = np.cos(alpha) / np.sin(alpha), np.cos(beta) / np.sin(beta)
    aside = np.array([-b[1], b[0]]) * (1.0 if left else -1.0)
    plan = A_m[:2] + (cot_a * b + aside) / (cot_a + cot_b)
    S = np.sqrt((b**2).sum())
    d_A, d_B = S * np.sin(beta) / np.sin(alpha + beta), S * np.sin(alpha) / np.sin(alpha + beta)
    height = 0.5 * (A_m[2] + d_A * np.tan(v_A) + B_m[2] + d_B * np.tan(v_B)) - target_height_m
    return np.array([plan[0], plan[1], height])


def forward_intersection(
    A_m: Float,
    B_m: Float,
    angles_rad: Float,
    sigma_m: Float,
    sigma_rad: Float,
    *,
    target_height_m: float = 0.0,
    left: bool = True,
) -> IntersectedPoint:
    """Place and covariance of a point seen from two stations.

    Parameters
    ----------
    A_m, B_m, angles_rad, target_height_m, left
        As of `intersect`.
    sigma_m : (2, 3) float64, m
        Of both stations, independent.
    sigma_rad : (4,) float64, rad
        Of the angles.
    """
    J = derivatives(A_m, B_m, angles_rad, left)
    variance = np.concatenate([np.ravel(sigma_m) ** 2, np.asarray(sigma_rad) ** 2])
    return IntersectedPoint(intersect(A_m, B_m, angles_rad, target_height_m, left), (J * variance) @ J.T)


def derivatives(A_m: Float, B_m: Float, angles_rad: Float, left: bool = True) -> Float:
    """Derivatives of the place by A, B and the angles, (3, 10)."""
    alpha, beta, v_A, v_B = angles_rad
    b, side = B_m[:2] - A_m[:2], 1.0 if left else -1.0
    S, gamma_sine = float(np.hypot(*b)), np.sin(alpha + beta)
    turn = side * np.array([[0.0, -1.0], [1.0, 0.0]])
    cot_a, cot_b = 1.0 / np.tan(alpha), 1.0 / np.tan(beta)
    total = cot_a + cot_b
    by_base = (cot_a * np.eye(2) + turn) / total
    by_cot_a = b / total - by_base @ b / total
    J = np.zeros((3, 10))
    J[:2, :2], J[:2, 3:5] = np.eye(2) - by_base, by_base
    J[:2, 6] = -by_cot_a / np.sin(alpha) ** 2
    J[:2, 7] = by_base @ b / total / np.sin(beta) ** 2
    tans = np.array([np.tan(v_A), np.tan(v_B)])
    d = S * np.array([np.sin(beta), np.sin(alpha)]) / gamma_sine
    J[2, 3:5] = 0.5 * (tans @ d) * b / S**2
    J[2, :2] = -J[2, 3:5]
    J[2, 2] = J[2, 5] = 0.5
    cot_sum = np.cos(alpha + beta) / gamma_sine
    J[2, 6] = 0.5 * (-tans[0] * d[0] * cot_sum + tans[1] * d[1] * (cot_a - cot_sum))
    J[2, 7] = 0.5 * (tans[0] * d[0] * (cot_b - cot_sum) - tans[1] * d[1] * cot_sum)
    J[2, 8:] = 0.5 * d / np.cos([v_A, v_B]) ** 2
    return J


def plan_accuracy(
    d_A_m: float, d_B_m: float, gamma_rad: float, sigma_rad: float, m_A_m: float, m_B_m: float, base_m: float
) -> float:
    """Point error in plan by the formula of the notes, M_P, m.

    Parameters
    ----------
    d_A_m, d_B_m : float, m
        From A and B to the point.
    gamma_rad : float, rad
        Angle at the point.
    sigma_rad : float, rad
        Of both horizontal angles.
    m_A_m, m_B_m : float, m
        Point errors of the stations, sqrt(m_X^2 + m_Y^2).
    base_m : float, m
    """
    angles = sigma_rad**2 * (d_A_m**2 + d_B_m**2) / np.sin(gamma_rad) ** 2
    return float(np.sqrt(angles + (d_B_m * m_A_m / base_m) ** 2 + (d_A_m * m_B_m / base_m) ** 2))


def scale_of_bar(true_m: float, ends_m: Float) -> float:
    """Scale of a net measured in local units, from a bar whose ends were intersected in it.

        lambda = L / |M - N|,    S' = lambda S,    X' = lambda X

    Parameters
    ----------
    true_m : float, m
        Length of the bar; its horizontal length where the ends are given in plan.
    ends_m : (2, 2) or (2, 3) float64, local units
    """
    return float(true_m / np.linalg.norm(ends_m[1] - ends_m[0]))


def with_control_error(point_error_m: float, control_error_m: float) -> float:
    """Error of points determined on control that is not free of error: m^2 = m_c^2 + m_p^2.

    With m_c one third of m_p the total is 5.4 % above m_p: the rule for control of close-range surveys.
    """
    return float(np.hypot(point_error_m, control_error_m))
