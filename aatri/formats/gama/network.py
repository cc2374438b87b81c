"""A network of gama-local as it is read: points, scalar observations, covariances."""

import math
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Row:
    """One scalar observation: type of geodetic.csv, ends, value and standard deviation in m or rad, unit of it."""

    type: str
    start: str
    end: str
    value: float
    sigma: float
    unit: float
    line: int
    via: str = ""
    set: str = ""
    start_height_m: float = math.nan
    end_height_m: float = math.nan


@dataclass(frozen=True)
class GivenPoint:
    """A point as it stands: its coordinates by letter, what is fixed, adjusted, and carries the datum."""

    id: str
    xyz: dict[str, float]
    fixed: str
    adjusted: str
    line: int

    @property
    def datum(self) -> str:
        """Coordinates on which the datum of a free network rests: those in capitals."""
        return "".join(c.lower() for c in self.adjusted if c.isupper())


@dataclass
class Network:
    """A network: points, observations, covariances between rows, observed coordinates."""

    axes: str = "ne"
    clockwise: bool = True
    sigma_apr: float = 10.0
    description: str = ""
    points: list[GivenPoint] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    covariances: list[tuple[int, int, float]] = field(default_factory=list)
    coordinates: list[tuple[str, str, float]] = field(default_factory=list)
    coordinate_covariance: list[tuple[int, int, float]] = field(default_factory=list)
