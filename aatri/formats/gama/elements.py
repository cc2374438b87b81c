"""The elements of a gama-local input file as they stand: points, observations in clusters with their covariances.

Lengths are in m, angles in gon, or degrees where they are written d-m-s; standard deviations in mm and cc (0.1 mgon),
or seconds of arc for angles in degrees. Source: GNU Gama manual, chapter Input data format for gama-local.

A network of gama-local as it is read: points, scalar observations, covariances.
"""

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

from aatri.errors import InputError
from aatri.formats.text.number_text import rad_from_dms
from aatri.formats.text.text_line import blank_separated
from aatri.formats.text.xml_tree import XmlElement, read_xml
from aatri.ids import clipped, several
from aatri.units import ANGLE_RAD

OF_GAMA = ("conf-pr", "tol-abs", "sigma-act", "algorithm", "cov-band", "update-constrained-coordinates", "language",
           "encoding", "iterations", "lang", "angles", "epoch", "version", "xmlns", "extern")  # fmt: skip
"""What concerns the program, or another one, and not the network."""

LENGTHS, ANGLES = ("distance", "s-distance", "dh"), ("direction", "angle", "z-angle", "azimuth")

CC_RAD, SECOND_RAD, MM = 1e-4 * ANGLE_RAD["gon"], ANGLE_RAD["arcsec"], 1e-3


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
    """The network of a file: points, observations, covariances between rows, observed coordinates.

    Raises
    ------
    InputError
        If the file is no gama-local input, or has what is not supported; the message names line and element.
    """

    path: Path
    axes: str = "ne"
    clockwise: bool = True
    sigma_apr: float = 10.0
    description: str = ""
    points: list[GivenPoint] = field(default_factory=list)
    rows: list[Row] = field(default_factory=list)
    covariances: list[tuple[int, int, float]] = field(default_factory=list)
    coordinates: list[tuple[str, str, float]] = field(default_factory=list)
    coordinate_covariance: list[tuple[int, int, float]] = field(default_factory=list)
    stdev: dict[str, list[float]] = field(default_factory=dict)
    """By the names of the attributes that state them for all observations of a type."""
    sets: int = 0

    def __post_init__(self) -> None:
        root = read_xml(self.path, ("gama-local",), "an input file of gama-local")
        for network in self._children(root, ("network",)):
            self.axes = network.get("axes-xy", "ne")
            self.clockwise = network.get("angles", "left-handed") == "left-handed"
            self._attributes(network, ("axes-xy", "angles"))
            for part in self._children(network, ("description", "parameters", "points-observations")):
                {
                    "description": self._description,
                    "parameters": self._parameters,
                    "points-observations": self._content,
                }[part.tag](part)

    def _description(self, part: XmlElement) -> None:
        self.description = " ".join(part.text.split())

    def _parameters(self, part: XmlElement) -> None:
        self._attributes(part, ("sigma-apr", "angular"))
        self.sigma_apr = self._number(part, "sigma-apr", 10.0)
        for name in ("latitude", "ellipsoid"):
            if part.get(name):
                raise part.error(f"{name}={part.get(name)!r} is not supported", "remove it: the frame is a local one")

    def _content(self, part: XmlElement) -> None:
        names = [f"{kind}-stdev" for kind in ("distance", "direction", "angle", "zenith-angle", "azimuth")]
        self._attributes(part, names)
        self.stdev = {name: self._default_sigma(part, name) for name in names}
        for child in self._children(part, ("point", "obs", "height-differences", "coordinates", "vectors")):
            tag = child.tag
            if tag == "point":
                self._point(child)
            elif tag == "coordinates":
                self._coordinates(child)
            else:
                self._cluster(child, tag)

    def _point(self, e: XmlElement) -> None:
        self._attributes(e, ("id", "x", "y", "z", "fix", "adj"))
        xyz = {axis: self._number(e, axis) for axis in "xyz" if axis in e.attributes}
        fixed, adjusted = e.get("fix", "").lower(), e.get("adj", "")
        for axis in fixed:
            if axis not in xyz:
                raise e.error(f"point {e.get('id')!r} is fixed in {axis}, but has none", f"give {axis}")
        datum = {c.lower() for c in adjusted if c.isupper()}
        if datum and datum != {c.lower() for c in adjusted}:
            raise e.error(
                f"point {e.get('id')!r} carries the datum in {', '.join(sorted(datum))} only",
                "a point carries the datum in all its coordinates, or in none",
            )
        self.points.append(GivenPoint(self._text(e, "id"), xyz, fixed, adjusted, e.line))

    def _coordinates(self, e: XmlElement) -> None:
        """Observed coordinates: points with a covariance matrix over all of them."""
        first = len(self.coordinates)
        if not any(child.tag == "cov-mat" for child in e.children):
            raise e.error("coordinates have no cov-mat", "give it, or of exact coordinates fix='xy'")
        for child in self._children(e, ("point", "cov-mat")):
            if child.tag == "point":
                self._point(child)
                point = self.points[-1]
                self.coordinates += [(point.id, axis, point.xyz[axis]) for axis in "xyz" if axis in point.xyz]
            else:
                for i, j, value in self._matrix(child, len(self.coordinates) - first):
                    self.coordinate_covariance.append((first + i, first + j, value * MM**2))

    def _cluster(self, e: XmlElement, tag: str) -> None:
        inside = {"obs": (*LENGTHS, *ANGLES), "height-differences": ("dh",), "vectors": ("vec",)}[tag]
        self._attributes(e, ("from", "from_dh", "orientation"))
        self.sets += 1
        first = len(self.rows)
        matrix = None
        for child in self._children(e, (*inside, "cov-mat")):
            if child.tag == "cov-mat":
                matrix = child
            elif child.tag == "vec":
                self._vector(child)
            else:
                self.rows.append(self._row(child, e))
        rows = self.rows[first:]
        if matrix is not None:
            for i, j, value in self._matrix(matrix, len(rows)):
                self.covariances.append((first + i, first + j, value * rows[i].unit * rows[j].unit))
        for k, row in enumerate(rows if matrix is None else ()):
            if not 0 < row.sigma < math.inf:
                what = f"observation {k + 1} of the cluster has {'no' if row.sigma == 0 else 'an impossible'} stdev"
                raise InputError(what, where=f"{self.path}:{row.line}", remedy="give stdev, more than 0")

    def _row(self, e: XmlElement, cluster: XmlElement) -> Row:
        tag = e.tag
        self._attributes(e, ("from", "to", "bs", "fs", "val", "stdev", "from_dh", "to_dh", "bs_dh", "fs_dh", "dist"))
        station = e.get("from") or cluster.get("from")
        if not station:
            raise e.error(f"{tag} has no `from`", "name the station here or in <obs>")
        heights = (
            self._number(e, "from_dh", self._number(cluster, "from_dh", math.nan)),
            self._number(e, "to_dh", math.nan),
        )
        if tag in ANGLES:
            value, unit = self._angle(e)
            if tag != "z-angle" and not self.clockwise:
                value = -value
            value = value % (2 * math.pi)
        else:
            value, unit = self._number(e, "val"), MM
        sigma = self._sigma(e, tag, unit, value)
        if tag == "angle":
            heights = (self._number(e, "bs_dh", math.nan), self._number(e, "fs_dh", math.nan))
            return Row(
                "angle", self._text(e, "bs"), self._text(e, "fs"), value, sigma, unit, e.line, station, "", *heights
            )
        kind = {
            "distance": "horizontal_distance",
            "s-distance": "distance",
            "dh": "height_difference",
            "z-angle": "zenith",
        }.get(tag, tag)
        set_ = f"{station} {self.sets}" if tag == "direction" else ""
        return Row(kind, station, self._text(e, "to"), value, sigma, unit, e.line, "", set_, *heights)

    def _vector(self, e: XmlElement) -> None:
        self._attributes(e, ("from", "to", "dx", "dy", "dz", "from_dh", "to_dh"))
        heights = self._number(e, "from_dh", math.nan), self._number(e, "to_dh", math.nan)
        for axis in "xyz":
            ends, value = (self._text(e, "from"), self._text(e, "to")), self._number(e, f"d{axis}")
            self.rows.append(Row(f"d{axis}", *ends, value, 0.0, MM, e.line, "", "", *heights))

    def _sigma(self, e: XmlElement, tag: str, unit: float, value: float) -> float:
        """Standard deviation of an observation, or that of its type: `a b c` is a + b D^c, D in km; 0: none.

        A levelled section of `dist` km has that of sigma-apr in mm times its root.
        """
        if "stdev" in e.attributes:
            return self._number(e, "stdev") * unit
        if tag == "dh" and "dist" in e.attributes:
            return self.sigma_apr * math.sqrt(max(self._number(e, "dist"), 0.0)) * unit
        name = {"s-distance": "distance", "z-angle": "zenith-angle"}.get(tag, tag)
        stdev = self.stdev.get(f"{name}-stdev", ())
        if not stdev:
            return 0.0
        a, b, c = (*stdev, *(0.0, 0.0, 1.0)[len(stdev) :])
        try:
            return (a + b * max(value / 1000.0, 0.0) ** c if tag in LENGTHS else a) * unit
        except (OverflowError, ZeroDivisionError):
            return math.inf

    def _default_sigma(self, part: XmlElement, name: str) -> list[float]:
        """The numbers of a standard deviation by type: `a b c` of distances, else `a`."""
        words = blank_separated(part.get(name, ""))
        if len(words) > (3 if name == "distance-stdev" else 1):
            form = "`a b c`, the last two of distances only"
            raise part.error(f"{name} has {len(words)} numbers", f"write {form}")
        return [part.parsed(word, name) for word in words]

    def _angle(self, e: XmlElement) -> tuple[float, float]:
        text = self._text(e, "val")
        if not re.search("[0-9]-", text):  # 7e-5 is a number
            return self._number(e, "val") * ANGLE_RAD["gon"], CC_RAD
        try:
            return rad_from_dms(text), SECOND_RAD
        except ValueError as error:
            raise e.error(f"val is {clipped(text)!r}, not an angle", "write d-m-s or gon") from error

    def _matrix(self, e: XmlElement, n: int) -> list[tuple[int, int, float]]:
        """Upper band by rows: row, column, value."""
        self._attributes(e, ("dim", "band"))
        dim, band = self._count(e, "dim"), self._count(e, "band")
        if dim != n:
            raise e.error(f"cov-mat of dimension {dim} for {n} observations", "both are to be equal")
        places = [(i, j) for i in range(dim) for j in range(i, min(dim, i + band + 1))]
        values = [e.parsed(word, "cov-mat") for word in blank_separated(e.text)]
        if len(values) != len(places):
            raise e.error(
                f"cov-mat has {several(len(values), 'number')}, not {len(places)}", "give the upper band by rows"
            )
        if negative := [value for (i, j), value in zip(places, values) if i == j and value < 0]:
            raise e.error(f"cov-mat has the variance {negative[0]:g}", "the diagonal is not negative")
        return [(i, j, value) for (i, j), value in zip(places, values)]

    def _children(self, e: XmlElement, allowed: tuple[str, ...]) -> list[XmlElement]:
        for child in e.children:
            if child.tag not in allowed:
                raise child.error(
                    f"element {clipped(child.tag)!r} is not supported",
                    f"inside {e.tag} there may be {', '.join(allowed)}",
                )
        return e.children

    def _attributes(self, e: XmlElement, allowed: tuple[str, ...] | list[str]) -> None:
        for name in e.attributes:
            if name not in allowed and name not in OF_GAMA and name not in ("latitude", "ellipsoid"):
                raise e.error(f"attribute {clipped(name)!r} of {e.tag} is not supported", "remove it")

    def _text(self, e: XmlElement, name: str) -> str:
        value = e.get(name).strip(" \t\r\n")
        if not value:
            raise e.error(f"{e.tag} has no {name!r}", "give it")
        return value

    def _number(self, e: XmlElement, name: str, default: float | None = None) -> float:
        if name not in e.attributes and default is not None:
            return default
        return e.parsed(self._text(e, name), name)

    def _count(self, e: XmlElement, name: str) -> int:
        return abs(e.integer(self._text(e, name), name))
