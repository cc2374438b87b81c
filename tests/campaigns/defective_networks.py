"""Networks that leave something open, as block folders: one defect each, all else determined."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aatri.artifacts.block import Block
from aatri.stages.block.tables import TablesOptions, tables
from aatri.stages.bundle_adjustment.bundle import BundleOptions

HEAD = """aatri_block: 1
name: network
frames: {local: {axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}
"""
FIXED = {"A": (0.0, 0.0, 0.0), "B": (60.0, 5.0, 8.0), "C": (20.0, 55.0, -4.0), "D": (30.0, 20.0, 45.0)}
NEW = {"P": (40.0, 35.0, 6.0), "Q": (-15.0, 30.0, 12.0), "R": (25.0, -20.0, 3.0)}
SIGMA_M, SIGMA_DEG = 0.003, 0.001

Rows = list[tuple[str, ...]]


def network(
    control: Sequence[str],
    rows: Rows,
    conditions: str = "",
    more: dict[str, tuple[float, ...]] | None = None,
    plan: bool = False,
) -> tuple[Block, BundleOptions]:
    """A network of FIXED and NEW points; `control` is exact, the others have approximate coordinates.

    Parameters
    ----------
    rows : list of (type, from, to) or (type, from, to, set)
        What is observed; values are those of the true places, with errors.
    more : dict of str to (3,) float, m
        Further points.
    plan : bool
        Control in plan alone.
    """
    places = {**FIXED, **NEW, **(more or {})}
    used = {name for row in rows for name in row[1:3]} | set(control) | set(more or {})
    rng = np.random.default_rng(3)
    role = "XY:control" if plan else "control"
    points = []
    for name in sorted(used):
        x, y, z = places[name]
        if name in control:
            points.append(f"{name},{x},{y},{z},0,0,0,{role}")
        else:
            off = rng.normal(0, 0.05, 3)
            points.append(f"{name},{x + off[0]},{y + off[1]},{z + off[2]},,,,approximate")
    lines = []
    for kind, start, end, *group in rows:
        value, sigma = _observed(kind, np.array(places[start]), np.array(places[end]), rng)
        lines.append(f"{kind},{start},{end},{value!r},{sigma},{group[0] if group else ''}")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder)
        (path / "block.yaml").write_text(HEAD)
        (path / "ground_points.csv").write_text("\n".join(["point,X,Y,Z,sX,sY,sZ,role", *points]) + "\n")
        (path / "geodetic.csv").write_text("\n".join(["type,from,to,value,sigma,set", *lines]) + "\n")
        if conditions:
            (path / "relative_control.yaml").write_text(conditions)
        block = tables(options=TablesOptions(path=path))
    return block, BundleOptions()


def _observed(kind: str, a: np.ndarray, b: np.ndarray, rng: np.random.Generator) -> tuple[float, float]:
    """Value of an observation and its standard deviation; sets have their zero at 20 degrees."""
    d = b - a
    bearing = math.degrees(math.atan2(d[0], d[1])) % 360
    plan = float(np.hypot(d[0], d[1]))
    value = {
        "distance": float(np.linalg.norm(d)),
        "horizontal_distance": plan,
        "height_difference": float(d[2]),
        "azimuth": bearing,
        "direction": (bearing - 20.0) % 360,
        "zenith": math.degrees(math.atan2(plan, d[2])),
    }[kind]
    sigma = SIGMA_DEG if kind in ("azimuth", "direction", "zenith") else SIGMA_M
    return value + float(rng.normal(0, sigma)), sigma


def distances(starts: str, ends: str) -> Rows:
    """Slope distances from all to all."""
    return [("distance", a, b) for a in starts for b in ends if a != b]


def unoriented_set() -> tuple[Block, BundleOptions]:
    """A known station sees new points alone: nothing says where its zero is."""
    rows: Rows = [("direction", "A", p, "S1") for p in "PQR"] + [("horizontal_distance", "A", p) for p in "PQR"]
    rows += [("horizontal_distance", a, b) for a, b in ("PQ", "QR", "PR")]
    return network("A", rows + [("height_difference", "A", p) for p in "PQR"])


def set_of_one() -> tuple[Block, BundleOptions]:
    """A set of one direction finds its own orientation and nothing else."""
    return network("ABCD", [*distances("ABCD", "PQ"), ("direction", "P", "Q", "S1")])


def distances_in_a_plane() -> tuple[Block, BundleOptions]:
    """Slope distances from a station to three points of its own height: its height is open."""
    more = {"E": (80.0, 0.0, 0.0), "F": (0.0, 70.0, 0.0), "S": (30.0, 25.0, 0.0)}
    return network(("A", "E", "F"), distances("S", ("A", "E", "F")), more=more)  # type: ignore[arg-type]


def plan_without_distance() -> tuple[Block, BundleOptions]:
    """Directions and an azimuth at one known point: the size of the net is open."""
    rows: Rows = [("direction", a, b, f"S{a}") for a in "APQR" for b in "APQR" if a != b]
    return network("A", [*rows, ("azimuth", "A", "P")], plan=True)


def plane_of_collinear_points() -> tuple[Block, BundleOptions]:
    """A plane through points of a line turns about it."""
    more = {"1": (10.0, 10.0, 5.0), "2": (20.0, 18.0, 9.0), "3": (30.0, 26.0, 13.0), "4": (45.0, 38.0, 19.0)}
    condition = "- {type: plane, points: ['1', '2', '3', '4'], sigma: 0.005}\n"
    return network("ABCD", distances("ABCD", "1234"), condition, more)


def point_of_a_plane_alone() -> tuple[Block, BundleOptions]:
    """A point that nothing but an exact plane holds."""
    more = {"1": (10.0, 10.0, 5.0), "2": (20.0, 30.0, 5.0), "3": (30.0, 12.0, 5.0), "4": (22.0, 20.0, 5.0)}
    condition = "- {type: plane, points: ['1', '2', '3', '4'], exact: true}\n"
    return network("ABCD", distances("ABCD", "123"), condition, more)


def one_distance_for_a_datum() -> tuple[Block, BundleOptions]:
    """A free net of distances: size alone is given."""
    return network((), distances("PQRABC", "PQRABC"))
