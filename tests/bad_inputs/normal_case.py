"""Recipes of a made block: vertical images without rotation, x = c (X - X0) / (Z0 - Z), y alike, c = 100 mm.

Errors of 3 um come from a fixed stream of random numbers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tests.bad_inputs.flown import STAGES, Edit
from tests.bad_inputs.kit import pipeline

Place = tuple[float, float, float]

C_MM, HALF_MM, SIGMA_MM = 100.0, 90.0, 0.003

SETTINGS = """\
aatri_block: 1
name: normal case
frames: {map: {axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg}
rotation: omega-phi-kappa
sigma: {image: 3, control: [0.02, 0.02, 0.02], position: [0.05, 0.05, 0.05]}
cameras:
  c: {kind: film, image_coordinates: photo, format: [180, 180], principal_distance: 100, distortion: {model: none}}
"""


def grid(x: tuple[float, float, int], y: tuple[float, float, int], height: float = 60.0) -> dict[str, Place]:
    """Points in rows and columns, on a gently rolling ground unless `height` is 0."""
    return {
        f"p{i}{j}": (float(a), float(b), height * (0.5 + 0.5 * np.sin(0.011 * a + 1.7) * np.cos(0.009 * b)))
        for i, a in enumerate(np.linspace(*x))
        for j, b in enumerate(np.linspace(*y))
    }


def seen(stations: Mapping[str, Place], points: Mapping[str, Place]) -> list[tuple[str, str, float, float]]:
    """Image points of what lies in the format: image, point, x, y in mm."""
    chance, found = np.random.default_rng(5), []
    for image, (x0, y0, z0) in stations.items():
        for point, (x, y, z) in points.items():
            scale = C_MM / (z0 - z)
            xy = np.array([x - x0, y - y0]) * scale
            if (np.abs(xy) < HALF_MM).all():
                found.append((image, point, *map(float, xy + chance.normal(0, SIGMA_MM, 2))))
    return found


def normal_case(
    folder: Path,
    stations: Mapping[str, Place],
    points: Mapping[str, Place],
    rows: list[tuple[str, str, float, float]],
    *edits: Edit,
    control: tuple[str, ...] = (),
    positions: bool = False,
    until: str = "strips",
    **options: str,
) -> None:
    """Write a block of stations `STRIP-NUMBER`, without the points that one image shows, and the stages to run."""
    shown = Counter(point for _, point, *_ in rows)
    rows = [row for row in rows if shown[row[1]] > 1]
    tables = {"block.yaml": SETTINGS}
    numbers = [(image, *image.split("-")) for image in stations]
    tables["images.csv"] = _table("image,camera,strip,sequence", [f"{i},c,{s},{n}" for i, s, n in numbers])
    tables["image_points.csv"] = _table("image,point,x,y", [f"{i},{p},{x:.4f},{y:.4f}" for i, p, x, y in rows])
    if control:
        tables["ground_points.csv"] = _table("point,X,Y,Z,role", [
            "{},{:.3f},{:.3f},{:.3f},control".format(name, *points[name]) for name in control
        ])  # fmt: skip
    if positions:
        tables["exterior.csv"] = _table("image,X,Y,Z,use", [
            "{},{:.3f},{:.3f},{:.3f},observed".format(image, *place) for image, place in stations.items()
        ])  # fmt: skip
    for edit in edits:
        edit(tables)
    (folder / "block").mkdir()
    for name, text in tables.items():
        (folder / "block" / name).write_text(text)
    names = [n for n in STAGES if n not in ("refined", "strip_block")]
    lines = ["  block: {use: block/tables, with: {path: block}}"]
    for stage in names[: names.index(until) + 1]:
        body = STAGES[stage].format(interior="calibrated").replace("image_points: refined", "image_points: interior")
        given = f", with: {{{options[stage]}}}" if stage in options else ""
        lines.append(f"  {stage}: {{{body}{given}}}")
    pipeline(folder, "\n".join([*lines, ""]))


def _table(head: str, rows: list[str]) -> str:
    return "\n".join([head, *rows, ""])
