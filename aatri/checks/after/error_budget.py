"""Control that is not much better than the block: its share in the error of the points.

    m^2 = m_c^2 + m_p^2,        m_c <= m_p / 3:  m <= 1.054 m_p

Seen: control of 2 cm under images that would give 1 cm; the standard deviations of the points hold its share, and
nothing else says that a better survey, and no better image, would make them smaller.
Test: the RMS standard deviation m_c of control, in plan and in height, against that of the new points, m, with which
m_p^2 = m^2 - m_c^2. Where m_c is not below m, points are better than control by the mean of many, and m_p is not told.

Source: lecture notes on close range of Wuhan University, 5.1 (A1503).
"""

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.checks.finding import Finding
from aatri.checks.limits import CONTROL_SHARE
from aatri.observations.control import PARTS, control_of
from aatri.observations.poses import POINT
from aatri.orientation.bundle.result import BundleResult
from aatri.units import about


def error_budget(block: Block, result: BundleResult) -> list[Finding]:
    """A note for plan and for height where control is worse than a third of what the block gives without its errors."""
    control = control_of(block)
    if result.free is not None or POINT not in result.covariances or not control.observed.any():
        return []
    variance = np.where(control.observed, np.einsum("nii->ni", control.covariance_m2), np.nan)
    points = np.einsum("nii->ni", result.point_covariance_m2)
    new = np.ones(len(points), dtype=bool)
    new[control.point] = False
    findings = []
    for part, axes in PARTS:
        m_c, m = _rms(variance[:, axes]), _rms(points[new][:, axes])
        if not (np.isfinite(m_c) and np.isfinite(m) and m > 0):
            continue
        if m_c <= m * CONTROL_SHARE / np.hypot(1.0, CONTROL_SHARE):
            continue
        text = f"in {part} control has a standard deviation of {about(m_c)}, new points {about(m)}: "
        if m_c < m:
            without_control = float(np.sqrt(m**2 - m_c**2))
            text += f"without its errors {about(without_control)}, and control is to be better than a third of that"
        else:
            text += "they are as good by the mean of many only"
        findings.append(Finding("error_budget", "note", text, "", statistic=m_c / m))
    return findings


def _rms(variance: Float) -> float:
    finite = np.isfinite(variance) & (variance > 0)
    return float(np.sqrt(variance[finite].mean())) if finite.any() else float("nan")
