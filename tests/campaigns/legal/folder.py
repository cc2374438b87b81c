"""A scene as a block folder and a pipeline, as a user would have written them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.campaigns.legal.cell import Cell
from tests.campaigns.legal.flight import (
    ATTITUDE_DEG,
    CAMERAS,
    CONTROL_M,
    FIDUCIAL_MM,
    GROUND_M,
    IMAGE_MM,
    PIXEL_MM,
    POSITION_M,
    Float,
    Scene,
    rotation,
    stated_camera,
)

MARKS_MM = {"1": (106.0, -106.0), "2": (-106.0, -106.0), "3": (-106.0, 106.0), "4": (106.0, 106.0)}
WAYS = ("chain", "graph")
_CHAIN = """\
  models:      {use: relative_orientation/dependent, from: {block, image_points: refined}}
  strips:      {use: strip_formation/scale_transfer, from: {block, models}}
  absolute:    {use: absolute_orientation/similarity, from: {block, strips, image_points: refined}}
  initial:     {use: strip_adjustment/polynomial,
                from: {block, image_points: refined, strips, models, initial: absolute}}
"""
_GRAPH = "  initial:     {use: initial_orientation/graph, from: {block, image_points: refined}}\n"


def set_of(cell: Cell) -> str:
    """The set of additional parameters of a cell whose parameters are removable."""
    return "ebner12" if cell.camera == "film" else "brown_conrady"


def write_project(scene: Scene, folder: Path, way: str = "chain") -> None:
    """Write `block` and `pipeline.yaml`."""
    cell = scene.cell
    write_block(scene, folder / "block")
    calibration = f", with: {{self_calibration: {{set: {set_of(cell)}, remove: true}}}}"
    (folder / "pipeline.yaml").write_text(f"""\
# {cell}
run: run
seed: 1
stages:
  block:       {{use: block/tables, with: {{path: block}}}}
  interior:    {{use: interior_orientation/{"affine" if cell.camera == "film" else "calibrated"}, from: {{block}}}}
  refined:     {{use: image_refinement/systematic, from: {{block, image_points: interior}}\
{", with: {distortion: false}" if cell.parameters == "free" else ""}}}
{_CHAIN if way == "chain" else _GRAPH}\
  bundle:      {{use: bundle_adjustment/bundle, from: {{block, image_points: refined, initial}}\
{calibration if cell.parameters == "removable" else ""}}}
  accuracy:    {{use: accuracy/evaluation, from: {{block, solution: bundle}}}}
""")


def write_block(scene: Scene, folder: Path) -> None:
    """Write the block folder."""
    folder.mkdir(parents=True, exist_ok=True)
    cell, images, points = scene.cell, scene.image_ids, scene.point_ids
    (folder / "block.yaml").write_text(_block_yaml(cell))
    _table(
        folder / "images.csv",
        "image,camera,strip,sequence",
        [(i, "cam", f"s{s + 1}", k + 1) for i, s, k in zip(images, scene.strip, scene.sequence)],
    )
    rng = np.random.default_rng([cell.seed, 20])
    place = [_placed(rng) for _ in images]
    rays = scene.true_rays
    xy = [_as_measured(scene.xy_mm[k], place[rays.image[k]], cell) for k in range(len(scene.xy_mm))]
    _table(
        folder / "image_points.csv",
        "image,point,x,y",
        [(images[i], points[p], *v) for i, p, v in zip(rays.image, rays.point, xy)],
    )
    if cell.camera == "film":
        marks = [
            (i, name, *_as_measured(np.array(mark) + rng.normal(0, FIDUCIAL_MM, 2), at, cell))
            for i, at in zip(images, place)
            for name, mark in MARKS_MM.items()
        ]
        _table(folder / "fiducials.csv", "image,fiducial,x,y", marks)
    ground = [
        (points[p], *xyz, role)
        for role, rows, given in (("control", scene.control, scene.control_m), ("check", scene.check, scene.check_m))
        for p, xyz in zip(rows, given)
    ]
    _table(folder / "ground_points.csv", "point,X,Y,Z,role", ground)
    _exterior(scene, folder)


def _exterior(scene: Scene, folder: Path) -> None:
    position = dict(zip(scene.positioned.tolist(), scene.positions_m))
    sigma_m, rows = POSITION_M * _factor(scene.cell, "position"), []
    for k, name in enumerate(scene.image_ids):
        given = [*position[k], *[sigma_m] * 3] if k in position else [""] * 6
        turned = [*scene.angles_deg[k], *[ATTITUDE_DEG] * 3] if len(scene.angles_deg) else [""] * 6
        rows.append((name, *given, *turned))
    if position or len(scene.angles_deg):
        _table(folder / "exterior.csv", "image,X,Y,Z,sX,sY,sZ,a1,a2,a3,s1,s2,s3", rows)


def _factor(cell: Cell, kind: str) -> float:
    return cell.factor if cell.sigmas_of in (kind, "all") else 1.0


def _table(path: Path, header: str, rows: list[tuple[object, ...]]) -> None:
    text = [",".join(f"{v:.7f}" if isinstance(v, float) else str(v) for v in row) for row in rows]
    path.write_text("\n".join([header, *text, ""]))


def _placed(rng: np.random.Generator) -> tuple[Float, Float]:
    """How a film lies on the comparator: an affine transformation."""
    film = np.eye(2) + np.array([[rng.uniform(-3e-4, 3e-4), 0.0], [rng.uniform(-1e-4, 1e-4), rng.uniform(-3e-4, 3e-4)]])
    return rotation(0.0, 0.0, rng.normal(0, 0.005))[:2, :2] @ film, rng.uniform(100, 130, 2)


def _as_measured(xy_mm: Float, place: tuple[Float, Float], cell: Cell) -> tuple[float, float]:
    if cell.camera == "film":
        x, y = place[0] @ xy_mm + place[1]
        return float(x), float(y)
    half = CAMERAS["digital"][1] / PIXEL_MM
    return float(half + xy_mm[0] / PIXEL_MM), float(half - xy_mm[1] / PIXEL_MM)


def _block_yaml(cell: Cell) -> str:
    camera, film = stated_camera(cell), cell.camera == "film"
    half = CAMERAS[cell.camera][1]
    pixels = round(2 * half / PIXEL_MM)
    free = "sigmas: {principal_distance: .inf, principal_point: [.inf, .inf], k1: .inf}"
    marks = "fiducials: {" + ", ".join(f'"{name}": [{x}, {y}]' for name, (x, y) in MARKS_MM.items()) + "}"
    lines = [
        "kind: film" if film else "kind: digital",
        "image_coordinates: comparator" if film else "image_coordinates: pixel",
        *([] if film else [f"pixel: {{size: {PIXEL_MM}, origin: top-left-corner, y: down}}"]),
        f"format: [{2 * half}, {2 * half}]" if film else f"format: [{pixels}, {pixels}]",
        f"principal_distance: {camera['c']:.9g}",
        f"principal_point: [{camera['x0']:.9g}, {camera['y0']:.9g}]",
        f"distortion: {{model: brown, k1: {camera['k1']:.12g}}}",
        *([marks] if film else []),
        *([free] if cell.parameters == "free" else []),
    ]
    control = [round(s * _factor(cell, "control"), 6) for s in CONTROL_M]
    return f"""\
aatri_block: 1
name: legal
frames:
  local: {{axes: [east, north, up], crs: local}}
earth_curvature: ignore
units: {{ground: m, angle: deg, sigma_image: um, sigma_ground: m, sigma_angle: deg, time: s}}
rotation: omega-phi-kappa
sigma: {{image: {1000 * IMAGE_MM[cell.camera] * _factor(cell, "image"):.6g}, fiducial: {1000 * FIDUCIAL_MM:.6g}, \
control: {control}}}
terrain_height: {GROUND_M}
cameras:
  cam:
    {(chr(10) + "    ").join(lines)}
"""
