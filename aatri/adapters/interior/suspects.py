"""Suspects of the interior orientation, as a table."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from aatri.arrays import Text
from aatri.artifacts.suspects import Suspects
from aatri.tables.schema import columns_of


def suspects_of(
    *,
    kind: str,
    row: npt.ArrayLike,
    image: Text,
    point: Text,
    verdict: str,
    size: npt.ArrayLike = np.nan,
    sigma: npt.ArrayLike = np.nan,
    test: npt.ArrayLike = np.nan,
) -> Suspects:
    """Suspects of one kind and verdict; size and sigma in mm."""
    n = len(image)
    return Suspects(
        kind=np.full(n, kind),
        row=np.broadcast_to(row, n),
        image=image,
        point=point,
        stage=np.full(n, "interior_orientation"),
        size=np.broadcast_to(np.asarray(size, dtype=np.float64), n),
        unit=np.full(n, "mm"),
        sigma=np.broadcast_to(np.asarray(sigma, dtype=np.float64), n),
        test=np.broadcast_to(np.asarray(test, dtype=np.float64), n),
        verdict=np.full(n, verdict),
    )


def joined(*parts: Suspects) -> Suspects:
    """One table of several."""
    return Suspects(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in columns_of(Suspects)})
