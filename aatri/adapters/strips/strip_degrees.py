"""The highest degree of each strip's polynomial, as the user gives it: one for all, and others for single strips."""

from collections.abc import Mapping

import numpy as np

from aatri.arrays import Int, Text
from aatri.errors import InputError
from aatri.ids import shown


def highest_degree(degree: int, single: Mapping[str, int]) -> int:
    """The highest of all strips."""
    return max(degree, *single.values()) if single else degree


def degrees_of_strips(names: Text, degree: int, single: Mapping[str, int]) -> Int:
    """Of every strip, (n_strips,).

    Parameters
    ----------
    names : (n_strips,) str
        Ids of free strips: those of the block, with .1 .2 ... where a strip is broken.
    single : mapping
        Degrees by the id of a free strip, or of a strip of the block for all its parts.

    Raises
    ------
    InputError
        If an id is that of no strip.
    """
    degrees = np.full(len(names), degree)
    ids = [str(name) for name in names]
    unsplit = [name.rpartition(".")[0] if name.rpartition(".")[2].isdigit() else name for name in ids]
    for strip, value in single.items():
        of_name = [k for k, name in enumerate(ids) if name == strip]
        of_name = of_name or [k for k, name in enumerate(unsplit) if name == strip]
        if not of_name:
            raise InputError(
                f"`degrees` names strip {strip}, which is not among the strips {shown(ids)}",
                remedy="give ids of free strips, as the log of strip formation lists them",
            )
        degrees[of_name] = value
    return degrees
