"""The blocks that bad inputs are made of, and the stages to run.

`tables` is the folder with a bit of everything of the tests of reading, block/tables alone. `film` is simulated: two
strips of four film images at 1 : 2500, c = 153.84 mm, 40 new points, 8 control and 3 check points, noise 5 um,
positions with 5 cm. `digital`: three strips of five images of 20 megapixels from 100 m, 80 new points, 8 control and 4
check points, positions with 3 cm, no relief to speak of. `normal_case`: vertical images without rotation of a
row's own `stations` and `points`, x = c (X - X0) / (Z0 - Z), y alike, c = 100 mm, with errors of 3 um.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from tests.bad_inputs.changes import Tables
from tests.formats.tables.block_folder import FILES

BLOCKS = Path(__file__).parent / "blocks"
Place = tuple[float, float, float]

STAGES = {
    "interior": "use: interior_orientation/{interior}, from: {{block}}",
    "refined": "use: image_refinement/systematic, from: {{block, image_points: interior}}",
    "models": "use: relative_orientation/dependent, from: {{block, image_points: {points}}}",
    "strips": "use: strip_formation/scale_transfer, from: {{block, models}}",
    "absolute": "use: absolute_orientation/similarity, from: {{block, strips, image_points: {points}}}",
    "strip_block": "use: strip_adjustment/polynomial, "
    "from: {{block, image_points: {points}, strips, models, initial: absolute}}",
    "bundle": "use: bundle_adjustment/bundle, from: {{block, image_points: {points}, initial: absolute}}",
    "accuracy": "use: accuracy/evaluation, from: {{block, solution: bundle}}",
}

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


def tables_of(base: str, row: Mapping[str, Any]) -> Tables:
    """The tables of a base block."""
    if base == "tables":
        return dict(FILES)
    if base == "normal_case":
        return _normal_case(row)
    return {path.name: path.read_text() for path in sorted((BLOCKS / base).iterdir())}


def pipeline_of(base: str, until: str, options: Mapping[str, str]) -> str:
    """The stages of pipeline.yaml as far as one of them; options of stages as YAML."""
    lines = [f"  block: {{use: block/tables, with: {{path: block{_more(options, 'block')}}}}}"]
    left_out = {"strip_block"} - {until} | ({"refined"} if base == "normal_case" else set())
    names = [] if until == "block" else list(STAGES)[: list(STAGES).index(until) + 1]
    points = "interior" if base == "normal_case" else "refined"
    for stage in names:
        if stage not in left_out:
            body = STAGES[stage].format(interior="affine" if base == "film" else "calibrated", points=points)
            given = f", with: {{{options[stage]}}}" if stage in options else ""
            lines.append(f"  {stage}: {{{body}{given}}}")
    return "\n".join([*lines, ""])


def _more(options: Mapping[str, str], stage: str) -> str:
    return f", {options[stage]}" if stage in options else ""


def _normal_case(row: Mapping[str, Any]) -> Tables:
    """`stations` STRIP-NUMBER, `points` by name or as a grid; `control` the ids of control, `positions` observed."""
    stations, points = {key: tuple(place) for key, place in row["stations"].items()}, _points(row["points"])
    numbers = [(image, *image.split("-")) for image in stations]
    tables: Tables = {"block.yaml": SETTINGS}
    tables["images.csv"] = _table("image,camera,strip,sequence", [f"{i},c,{s},{n}" for i, s, n in numbers])
    tables["image_points.csv"] = _table("image,point,x,y", _seen(stations, points))
    if "control" in row:
        tables["ground_points.csv"] = _table(
            "point,X,Y,Z,role",
            ["{},{:.3f},{:.3f},{:.3f},control".format(name, *points[name]) for name in row["control"]],
        )
    if row.get("positions"):
        tables["exterior.csv"] = _table(
            "image,X,Y,Z,use",
            ["{},{:.3f},{:.3f},{:.3f},observed".format(image, *place) for image, place in stations.items()],
        )
    return tables


def _points(row: Mapping[str, Any]) -> dict[str, Place]:
    """Points by name; or a grid x, y on ground rolling by `height`; or x along a cylinder of some radius."""
    if "cylinder_m" in row:
        radius, angles = row["cylinder_m"], np.linspace(-1.2, 1.2, 6)
        return {
            f"p{i}{j}": (x, float(radius * np.sin(t)), float(radius * (1 - np.cos(t))))
            for i, x in enumerate(row["x"])
            for j, t in enumerate(angles)
        }
    if "x" not in row:
        return {name: tuple(place) for name, place in row.items()}
    height = row.get("height", 60.0)
    return {
        f"p{i}{j}": (float(a), float(b), height * (0.5 + 0.5 * np.sin(0.011 * a + 1.7) * np.cos(0.009 * b)))
        for i, a in enumerate(np.linspace(*row["x"]))
        for j, b in enumerate(np.linspace(*row["y"]))
    }


def _seen(stations: Mapping[str, Place], points: Mapping[str, Place]) -> list[str]:
    """Image points of what lies in the format."""
    chance, seen = np.random.default_rng(5), []
    for image, (x0, y0, z0) in stations.items():
        for point, (x, y, z) in points.items():
            xy = np.array([x - x0, y - y0]) * C_MM / (z0 - z)
            if (np.abs(xy) < HALF_MM).all():
                seen.append("{},{},{:.4f},{:.4f}".format(image, point, *(xy + chance.normal(0, SIGMA_MM, 2))))
    return seen


def without_single_points(text: str) -> str:
    """image_points.csv without points that one image shows."""
    head, *rows = text.splitlines()
    shown = Counter(row.split(",")[1] for row in rows)
    return _table(head, [row for row in rows if shown[row.split(",")[1]] > 1])


def _table(head: str, rows: list[str]) -> str:
    return "\n".join([head, *rows, ""])
