"""Rows of a kind of residuals."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.residuals import Residuals


def _of(*kinds: str) -> Residuals:
    """Of these kinds; every second row is not in use."""
    n = len(kinds)
    texts = {name: np.full(n, "") for name in ("image", "point", "unit")}
    return Residuals(kind=np.array(kinds, dtype=np.str_), row=np.arange(n, dtype=np.int32), residual=np.zeros((n, 3)),
                     sigma=np.ones((n, 3)), active=np.arange(n) % 2 == 0, **texts)  # fmt: skip


@pytest.mark.parametrize("kinds", [("b", "b", "a", "b", "c"), ("a",), ()])
def test_rows_of_a_kind_wherever_they_stand(kinds: tuple[str, ...]) -> None:
    residuals = _of(*kinds)
    assert residuals.kinds == sorted(set(kinds))
    for kind in (*kinds, "none"):
        of_kind = residuals.of_kind(kind)
        assert of_kind.tolist() == [k for k, other in enumerate(kinds) if other == kind]
        assert residuals.used(kind).tolist() == [k for k in of_kind.tolist() if k % 2 == 0]
