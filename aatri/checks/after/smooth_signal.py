"""Residuals whose common part is smooth over the plate.

Seen: a lens error that no parameter takes: orientations and points have taken up most of it, heights bend by the rest,
and collocation, which sees residuals alone, mends a part of it.
Test: length and size of the signal's covariance function against the plate and the noise.
"""

from collections.abc import Mapping

from aatri.arrays import Float, Text
from aatri.checks.finding import Finding
from aatri.checks.limits import LARGE_SIGNAL, SMOOTH_SIGNAL
from aatri.orientation.refinement.collocation import Collocation


def smooth_signal(signals: Mapping[int, Collocation], ids: Text, radius_mm: Float) -> list[Finding]:
    """Cameras or sessions whose residuals ask for parameters.

    Parameters
    ----------
    signals : mapping of int to Collocation
        By the numbers of the cameras or sessions.
    ids : (n,) str
    radius_mm : (n,) float64, mm
        Of the plates, to their farthest point.
    """
    findings = []
    for unit, signal in signals.items():
        f = signal.function
        if f is None or f.variance_mm2 < LARGE_SIGNAL**2 * f.noise_mm2 or f.length_mm < SMOOTH_SIGNAL * radius_mm[unit]:
            continue
        text = (
            f"{ids[unit]}: the common part of the residuals is smooth over {f.length_mm:.0f} mm; of such errors they "
            "hold little, the rest bends the block, its heights first"
        )
        findings.append(Finding("smooth_signal", "warning", text, "let `self_calibration` of the bundle take it first"))
    return findings
