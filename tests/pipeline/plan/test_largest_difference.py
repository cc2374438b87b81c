"""How far two artifacts of the same stage are apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.pipeline.plan.compare import largest_difference


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ([1.0, -4.0, np.nan], [1.0, -4.2, np.nan], 0.05),
        ([np.nan, np.nan], [np.nan, np.nan], 0.0),
        ([], [], 0.0),
        ([0.0, 0.0], [0.0, 1e-9], np.inf),
        ([1.0, np.nan], [1.0, 2.0], np.inf),
        ([np.inf, 2.0], [np.inf, 2.0], 0.0),
        ([np.inf, 2.0], [-np.inf, 2.0], np.inf),
        ([np.inf, 2.0], [np.nan, 2.0], np.inf),
    ],
)
def test_a_column_is_measured_by_its_own_largest_magnitude(
    a: list[float], b: list[float], expected: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = {Path("a"): {"t/x": np.array(a)}, Path("b"): {"t/x": np.array(b)}}
    monkeypatch.setattr("aatri.tables.hdf5.read_plain", files.__getitem__)
    assert largest_difference(Path("a"), Path("b")) == pytest.approx(expected)
