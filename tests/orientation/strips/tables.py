"""Models of a list as one table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aatri.orientation.strips.joints import ModelTable
from tests.orientation.strips.reference import Model


def table_of(models: Sequence[Model]) -> ModelTable:
    return ModelTable(
        np.array([m.left_from_right for m in models]),
        np.array([m.base for m in models]),
        np.array([m.orientation_covariance for m in models]),
        np.cumsum([0, *(len(m.point) for m in models)]),
        np.concatenate([m.point for m in models]),
        np.concatenate([m.xyz for m in models]),
        np.concatenate([m.covariance for m in models]),
    )
