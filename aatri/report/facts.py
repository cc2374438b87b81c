"""The facts of a project, and its accuracy as a standard states it.

The scale number is that of the median image point. The pixel on the ground is the pixel size times the scale number.

Source of the statement: ASPRS Positional Accuracy Standards for Digital Geospatial Data, edition 2 (2023): RMSE_H is
the root of the sum of the squares in X and Y, RMSE_3D that of all three, and 30 check points are asked for.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.codes import CHECK, CONTROL, OBSERVED_VALUE
from aatri.evaluation.limits import ENOUGH_CHECK_POINTS
from aatri.ids import shown
from aatri.report.drawing.plan import footprints, image_rows
from aatri.report.drawing.rays import principal_distances, ray_scales
from aatri.report.limits import DOWNWARDS, LEAST_SIDEWAYS, PARALLEL_STRIPS
from aatri.report.view.numbers import counted, in_trade_unit, number, spoken
from aatri.units import METRES_OF_MODEL, UNITS_OF_MODEL, listed, rms_alike, together

MOST_CAMERAS, MOST_TYPES = 3, 8
OF_CAMERAS = ("camera", "additional")
"""Groups of parameters that are those of a camera model, or of a set beside it."""
TIES = {"control": "control", "position": "positions"}
"""Observations that tie a block to the ground, by kind."""
COORDINATES = ("dX", "dY", "dZ")
"""Types of geodetic observations that are those of one: a baseline."""


def facts(block: Block | None, solution: Solution | None) -> dict[str, str]:
    """Images, cameras, scale, distance, pixel on the ground, rays, frame, by name; without what is not known."""
    if block is None:
        return {}
    made = {}
    of_images = len(block.images) and (solution is None or solution.images.oriented.any())
    if not of_images:
        made["points"] = number(len(block.points))
        kinds = block.geodetic.type[block.geodetic.active]
        names = np.where(np.isin(kinds, COORDINATES), "coordinate difference", kinds)
        counts = [counted(int((names == name).sum()), str(name)) for name in np.unique(names)]
        made["observed"] = shown(counts, MOST_TYPES)
    else:
        strips = f" in {counted(len(block.strips), 'strip')}" if len(block.strips) else ""
        made["images"] = f"{number(int(block.images.active.sum()))}{strips}"
    c = block.cameras
    if len(c) and "images" in made:
        c_mm = principal_distances(block, solution)
        cameras = [f"{name} ({kind}, c {round(mm, 3):g} mm)" for name, kind, mm in zip(c.id, c.kind, c_mm)]
        made["cameras" if len(c) > 1 else "camera"] = shown(cameras, MOST_CAMERAS)
    if solution is not None and solution.images.oriented.any():
        made |= _flight(block, solution) | _overlaps(block, solution)
    if not has_scale(block):
        made[METRES_OF_MODEL] = f"{UNITS_OF_MODEL}: no observation gives the scale"
    frame = block.frames.crs[0] if len(block.frames) else ""
    if frame:
        vertical = str(block.frames.vertical[0])
        made["coordinates"] = f"{frame}{f', heights {vertical}' if vertical else ''}"
    return made


def was_done(solution: Solution | None, block: Block | None, use: str, options: Mapping[str, Any]) -> str:
    """What the last adjustment was made of and how, in sentences; empty without one.

    Parameters
    ----------
    use : str
        Role and variant of its stage.
    options : mapping
        Those of its stage.
    """
    if solution is None:
        return ""
    residuals, kinds = solution.residuals, []
    for kind in residuals.kinds:
        used = residuals.used(kind)
        if len(used) and in_trade_unit(str(residuals.unit[used[0]]))[1]:  # a prior of several units is none
            exact = (np.nan_to_num(residuals.sigma[used]) == 0).all()
            kinds.append(f"{counted(len(used), kind)}{' (held exactly)' if exact else ''}")
    figures = solution.metrics()
    parts = [counted(int(figures[name] or 0), name[:-1]) for name in ("images", "points") if figures[name]]
    by = f"by {listed(kinds, '')}" if kinds else ""
    sentences = [f"{spoken(use.partition('/')[0])} of {listed(parts, '')}{by}".rstrip()]
    if options.get("datum") in ("free", "minimal"):
        ties, datum = [name for kind, name in TIES.items() if len(residuals.used(kind))], options["datum"]
        left = f"what {' and '.join(ties)} leave{'s' * (ties == ['control'])} open of the datum is {datum}"
        sentences.append(left if ties else f"the datum is {datum}: nothing ties the block to the ground")
    if "self_calibration" in options and figures["images"]:
        sentences.append(_cameras(solution))
    if method := (options.get("blunders") or {}).get("method"):
        sentences.append(f"the search for gross errors was set to {method}")
    ground = None if block is None else block.ground_points
    if checked := 0 if ground is None else int((ground.given_as(CHECK) & ~ground.given_as(CONTROL)).sum()):
        sentences.append(f"{counted(checked, 'check')} took no part")
    return " ".join(f"{text[0].upper()}{text[1:]}." for text in sentences)


def _cameras(solution: Solution) -> str:
    p, sets = solution.parameters, solution.calibrated_sets
    if not (np.isin(p.group, OF_CAMERAS) & (p.sigma != 0)).any():  # removed ones have 0
        return "cameras are as the block says"
    names = [] if sets is None else np.unique(sets.set).tolist()
    return f"cameras are estimated{f' ({shown(names)})' if names else ''}"


def without_comparison(block: Block | None, figures: Mapping[str, float | int | None]) -> str:
    """Why nothing is compared at check points: there are none, they cannot carry the datum, or none is determined."""
    count = 0 if block is None else int(block.ground_points.given_as(CHECK).sum())
    if not count:
        return "no check points"
    free = figures.get("check_aligned_components") == -1
    they, none = ("it", "it is not") if count == 1 else ("they", "none of them is")
    why = f"the datum is free, and {they} cannot carry what is open of it" if free else f"{none} determined"
    return f"{counted(count, 'check')} cannot be compared: {why}"


def has_scale(block: Block | None) -> bool:
    """Whether metres are metres: something observed gives the scale, or start values in a system of the earth."""
    if block is None:
        return True
    of_the_earth = len(block.frames) > 0 and block.frames.crs[0] != "local" and len(block.exterior) > 1
    control, positions = block.ground_points.role == CONTROL, block.exterior.position_use == OBSERVED_VALUE
    at_places = max(int(control.any(axis=1).sum()), int(positions.sum())) > 1
    between = block.geodetic.active.any() or len(block.relative_control) or (block.images.rig != "").any()
    return bool(of_the_earth or at_places or between)


def _flight(block: Block, solution: Solution) -> dict[str, str]:
    rows, depth, scale = ray_scales(block, solution)
    if not len(rows):
        return {}
    image = block.image_points.image[rows]
    down = -solution.images.ground_from_image[image, 2, 2]
    rays = solution.points.rays[solution.points.rays > 0]
    made = {
        "scale number": f"1 : {number(int(float(f'{np.median(scale):.3g}')))}",
        "flying height" if np.median(down) < DOWNWARDS else "distance to the object": together(
            [float(np.median(depth))]
        ),
        "rays per point": f"{rays.mean():.1f}" if len(rays) else "",
    }
    pixel = block.cameras.pixel_size_mm[block.images.camera[image]].mean(axis=1)
    if np.isfinite(pixel).all():
        made["pixel on the ground"] = together([float(np.median(pixel * scale)) * 1e-3])
    return {name: text for name, text in made.items() if text}


def _overlaps(block: Block, solution: Solution) -> dict[str, str]:
    """Overlaps of vertical images, medians: 1 - base / length of the footprint along it (Kraus, Photogrammetry 1)."""
    feet, xy = footprints(block, solution), solution.images.position_m[:, :2]
    order = image_rows(block, xy)
    strip = block.images.strip[order]
    k = np.flatnonzero((strip[1:] == strip[:-1]) & (strip[1:] >= 0) & np.isfinite(feet[order[:-1]]).all(axis=(1, 2)))
    first, base = order[k], xy[order[k + 1]] - xy[order[k]]
    length = np.linalg.norm(base, axis=1)
    along = base / np.maximum(length, 1e-9)[:, None]
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    sizes = [np.ptp(np.einsum("nkc,nc->nk", feet[first], axis), axis=1) for axis in (along, across)]
    if not len(first):
        return {}
    forward = float(np.median(1 - length / sizes[0]))
    of_strip = [strip[k] == s for s in np.unique(strip[k])]
    axis, middle = (np.array([values[rows].mean(axis=0) for rows in of_strip]) for values in (along, xy[first]))
    away = middle - middle[:, None]
    lateral = np.abs(axis[:, None, 0] * away[..., 1] - axis[:, None, 1] * away[..., 0])
    lateral /= np.array([np.median(sizes[1][rows]) for rows in of_strip])[:, None]
    beside = np.where((np.abs(axis @ axis.T) > PARALLEL_STRIPS) & (lateral > LEAST_SIDEWAYS), lateral, np.inf).min(
        axis=1
    )
    side = 1 - float(np.median(beside[np.isfinite(beside)])) if np.isfinite(beside).any() else 0.0
    overlaps = {"forward overlap": forward, "side overlap": side}
    return {name: f"{100 * share:.0f} %" for name, share in overlaps.items() if share > 0}


def accuracy_statement(figures: Mapping[str, float]) -> str:
    """What the check points say in the words of the standard; empty without any, or where they gave the datum."""
    n = int(figures.get("check_points", 0))
    x, y, z = (figures.get(f"check_rmse_{axis}_m", np.nan) for axis in "xyz")
    sizes = {"RMSE_H": np.hypot(x, y), "RMSE_V": z, "RMSE_3D": np.linalg.norm([x, y, z])}
    parts = [f"{name} = {listed(*rms_alike([size], n))}" for name, size in sizes.items() if np.isfinite(size)]
    if not n or not parts or figures.get("check_aligned_components", 0) > 0:
        return ""
    text = f"Tested at {counted(n, 'check')}: {', '.join(parts)} (ASPRS edition 2, 2023)."
    if n < ENOUGH_CHECK_POINTS:
        text += f" The standard asks for at least {ENOUGH_CHECK_POINTS}."
    return text
