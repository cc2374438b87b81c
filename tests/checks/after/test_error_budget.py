"""Control worse than a third of the block's accuracy is told: m^2 = m_c^2 + m_p^2, m_c <= m_p / 3."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.small_blocks import adjusted_by, flown


@pytest.mark.parametrize(("control_m", "told"), [(0.001, False), (0.02, True)])
def test_control_worse_than_a_third_is_told_by_the_run(tmp_path: Path, control_m: float, told: bool) -> None:
    """Judged by hand from the standard deviations of the points; a third adds 5.4 %."""
    small = flown(strips=2, per_strip=4)
    small.observed = {}
    folder = small.write(tmp_path / "block")
    text = (folder / "block.yaml").read_text()
    (folder / "block.yaml").write_text(text.replace("control:\n  - 0.02\n  - 0.02\n  - 0.02", f"control: {control_m}"))
    done = adjusted_by("default", folder)
    notes = [line for line in done.lines if "control has a standard deviation" in line]
    points = done.bundle.points
    new = ~np.char.startswith(points.id, "C") & np.isfinite(points.covariance_m2).all(axis=(1, 2))
    m_plan = np.sqrt(np.einsum("nii->ni", points.covariance_m2[new])[:, :2].mean())
    worse = control_m > np.sqrt(max(m_plan**2 - control_m**2, 0.0)) / 3
    assert bool(worse) == told
    assert any("in plan" in note for note in notes) == told
    assert np.hypot(1.0, 1 / 3) == pytest.approx(1.054, abs=1e-4)
