"""A group: observations that are wrong together, how, and what that does."""

from dataclasses import dataclass, field

import numpy as np

from aatri.arrays import Float, Int
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.orientation.bundle.block import LINE, STRIP


@dataclass(frozen=True)
class Group:
    """Observations that are wrong together, and how."""

    place: int
    """Of their kind among the observations."""
    kind: str
    per: str
    unit: str
    cause: str
    """As of its `Candidates`."""
    rows: Int
    """(n,)."""
    H: Float
    """(n, m, k). Derivatives of their residuals by the parameters of the cause."""
    value: Float
    sigma: Float
    """(k,). Parameters, in units of the kind; a posteriori where sigma0 is above 1."""
    gain: float
    """By which they reduce v'v, over s^2."""
    sigma0: float
    """With the parameters."""
    harm: float = 0.0
    """Largest change of a coordinate of a point or of a projection centre, in its standard deviations."""
    change_m: float = 0.0
    """That change; of a point where one changes by more than its standard deviation."""
    moved: str = ""
    """What changes so."""
    or_else: tuple[tuple[str, str, str], ...] = ()
    """Unit's kind, unit and cause of others that explain as much."""
    undecided: Int = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """(j,). Rows of other units of the same kind that explain as much."""
    c_mm: float = float("nan")
    """Principal distance of its image points."""
    loosens: bool = False
    """See `Cause`."""
    removable: bool = False
    """It may be left out."""
    rejected: Int = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """(r,). Rows of the unit that are not in use."""
    H_of_rejected: Float | None = None
    """(r, m, k)."""

    @property
    def complexity(self) -> tuple[bool, bool, int]:
        """Of what explains as much the least is taken: cameras of a strip are rare; a camera; the fewest parameters."""
        if self.loosens:
            return False, False, 0
        of_image = self.kind == IMAGE_POINT
        return of_image and self.per in (STRIP, LINE), of_image, len(self.value)

    @property
    def factor(self) -> float:
        """Principal distance of the block over the one that is asked for: the correction is of measured coordinates."""
        return 1.0 - float(self.value[0]) / self.c_mm if self.cause == "principal distance" else 1.0

    @property
    def effect(self) -> Float:
        """Part of the residuals of its rows, (n, m)."""
        return self.H @ self.value
