"""The facts of a project, and its accuracy as a standard states it.

The scale number is that of the median image point: its distance from the projection centre along the camera's axis,
divided by the principal distance. The pixel on the ground is the pixel size times the scale number.

Source of the statement: ASPRS Positional Accuracy Standards for Digital Geospatial Data, edition 2 (2023): RMSE_H is
the root of the sum of the squares in X and Y, and 30 check points are asked for.
"""

from collections.abc import Mapping

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.evaluation.verdict import ENOUGH_CHECK_POINTS
from aatri.ids import shown
from aatri.report.view.numbers import number, together

MOST_CAMERAS = 3


def facts(block: Block | None, solution: Solution | None) -> dict[str, str]:
    """Images, cameras, scale, distance, pixel on the ground, rays, frame, by name; without what is not known."""
    if block is None:
        return {}
    made = {"images": f"{number(int(block.images.active.sum()))} in {number(len(block.strips))} strips"}
    if not len(block.strips):
        made["images"] = number(int(block.images.active.sum()))
    if not len(block.images):
        del made["images"]
    c = block.cameras
    if len(c):
        cameras = [f"{name} ({kind}, c {mm:g} mm)" for name, kind, mm in zip(c.id, c.kind, c.principal_distance_mm)]
        made["cameras" if len(c) > 1 else "camera"] = shown(cameras, MOST_CAMERAS)
    if solution is not None and len(solution.images):
        made |= _flight(block, solution)
    frame = block.frames.crs[0] if len(block.frames) else ""
    if frame:
        vertical = str(block.frames.vertical[0])
        made["coordinates"] = f"{frame}{f', heights {vertical}' if vertical else ''}"
    return made


def _flight(block: Block, solution: Solution) -> dict[str, str]:
    m, images, points = block.image_points, solution.images, solution.points
    used = np.flatnonzero(m.active & images.oriented[m.image] & np.isfinite(points.xyz_m[m.point]).all(axis=1))
    if not len(used):
        return {}
    view = -images.ground_from_image[m.image[used], :, 2]
    depth = np.einsum("ni,ni->n", view, points.xyz_m[m.point[used]] - images.position_m[m.image[used]])
    camera = block.images.camera[m.image[used]]
    scale = depth * 1e3 / block.cameras.principal_distance_mm[camera]
    rays = points.rays[points.rays > 0]
    made = {
        "scale number": f"1 : {number(int(float(f'{np.median(scale):.3g}')))}",
        "distance to the object": together([float(np.median(depth))]),
        "rays per point": f"{rays.mean():.1f}" if len(rays) else "",
    }
    pixel = block.cameras.pixel_size_mm[camera].mean(axis=1)
    if np.isfinite(pixel).all():
        made["pixel on the ground"] = together([float(np.median(pixel * scale)) * 1e-3])
    return {name: text for name, text in made.items() if text}


def accuracy_statement(figures: Mapping[str, float]) -> str:
    """What the check points say in the words of the standard; empty without any."""
    n = int(figures.get("check_points", 0))
    x, y, z = (figures.get(f"check_rmse_{axis}_m", np.nan) for axis in "xyz")
    parts = []
    if np.isfinite(x) and np.isfinite(y):
        parts.append(f"RMSE_H = {together([float(np.hypot(x, y))])}")
    if np.isfinite(z):
        parts.append(f"RMSE_V = {together([z])}")
    if not n or not parts:
        return ""
    text = f"Tested at {number(n)} check points: {', '.join(parts)} (ASPRS edition 2, 2023)."
    if n < ENOUGH_CHECK_POINTS:
        text += f" The standard asks for {ENOUGH_CHECK_POINTS}: with fewer it knows no accuracy class."
    return text
