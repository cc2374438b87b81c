"""Residuals of an adjustment and their tests, row by row: tables of a Solution."""

from functools import cached_property
from itertools import pairwise

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.tables.schema import Table, column


class Residuals(Table):
    """Residuals: adjusted minus observed."""

    kind: Text = column("str", doc="image_point, control, position, distance, strip_tie ..., film_prior ...")
    row: Int = column("i4", doc="row in its table of the Block; -1 if it has none", optional=True)
    image: Text = column("str", doc="id of the image or strip, empty if none")
    point: Text = column("str", doc="id of the point, empty if none")
    residual: Float = column(
        "f8", 3, unit="see unit", doc="residual per coordinate; NaN where there is none", optional=True
    )
    sigma: Float = column("f8", 3, unit="see unit", doc="a priori standard deviation; 0 exact", optional=True)
    active: Bool = column("bool", doc="False if rejected: then the residual is that of a predicted value")
    unit: Text = column("str", doc="unit of residual and sigma; empty: that of the parameter")

    @cached_property
    def _runs(self) -> dict[str, list[tuple[int, int]]]:
        """First and last row of each kind: millions follow each other, and are compared as texts once."""
        edges = np.flatnonzero(self.kind[1:] != self.kind[:-1]) + 1
        runs: dict[str, list[tuple[int, int]]] = {}
        for first, last in pairwise([0, *edges.tolist(), len(self.kind)] if len(self.kind) else []):
            runs.setdefault(str(self.kind[first]), []).append((first, last))
        return runs

    @property
    def kinds(self) -> list[str]:
        """Kinds that have rows, in the order of the alphabet."""
        return sorted(self._runs)

    def of_kind(self, kind: str) -> Int:
        """Rows of a kind, in use or not."""
        return np.concatenate([np.arange(0), *(np.arange(*run) for run in self._runs.get(kind, []))])

    def used(self, kind: str) -> Int:
        """Rows of a kind that are in use."""
        rows = self.of_kind(kind)
        return rows[self.active[rows]]


class Tests(Table):
    """Reliability of the observations, row by row as in residuals."""

    redundancy: Float = column("f8", 3, doc="redundancy number; NaN where there is no observation", optional=True)
    test: Float = column("f8", 3, doc="standardised residual w, N(0, 1) without gross error; NaN where uncontrolled",
                         optional=True)  # fmt: skip
    detectable: Float = column("f8", 3, unit="mm (image) or m", doc="gross error found with 80 % at a level of 0.1 %; "
                               "NaN where uncontrolled", optional=True)  # fmt: skip
    external: Float = column(
        "f8", 3, doc="largest effect of it on a function of the unknowns, in sigmas", optional=True
    )
    point_moved_m: Float = column("f8", 3, unit="m", doc="how far a detectable error moves its ground point",
                                  optional=True)  # fmt: skip
    image_moved_m: Float = column(
        "f8", 3, unit="m", doc="the same of the projection centre of its image", optional=True
    )
    image_turned_rad: Float = column("f8", 3, unit="rad", doc="the same of its rotation", optional=True)
