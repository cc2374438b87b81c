"""The four kinds of arrays that signatures speak of. Docstrings say shape and unit, these the kind of number."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Float: TypeAlias = npt.NDArray[np.float64]
Int: TypeAlias = npt.NDArray[np.integer[Any]]
"""Rows and counts, of any width."""
Bool: TypeAlias = npt.NDArray[np.bool_]
Text: TypeAlias = npt.NDArray[np.str_]
