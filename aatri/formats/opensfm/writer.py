"""Writing of an oriented block for OpenSfM: reconstruction.json, tracks.csv, ground_control_points.json.

OpenSfM's frame is the horizon of `reference_lla`: a block in a topocentric frame keeps it; one in a map is moved into
the horizon of its middle, which bends a plane of the map, and what this does to the image points is told. A local block
has no reference, and its control no coordinates there. Rays of control and check points are in
ground_control_points.json, all others in tracks.csv. The forms are those of the readers.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.conventions.lens_conversion import as_program_states
from aatri.formats.conventions.poses import stated_rotation, translation_of
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.exported_files import ControlPoint, control_points
from aatri.formats.results.horizon import Horizon, in_horizon
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import write_files
from aatri.geometry.rotations import log_rotation
from aatri.ids import shown
from aatri.progress import SILENT, Reporter

MODELS = ("opensfm-perspective", "opensfm-brown", "opensfm-fisheye", "opensfm-fisheye_opencv")
TRACKS = "OPENSFM_TRACKS_VERSION_v2"


def write_opensfm(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write the three files."""
    block, rays = oriented.block, oriented.rays
    forms = [_forms(lens) for lens in oriented.lenses]
    lenses = [
        as_program_states(lens, forms[k], reporter, allowed_px=writing.lens_misfit_px)
        for k, lens in enumerate(oriented.lenses)
    ]
    horizon = in_horizon(oriented, reporter)
    _, position, R, xyz_m = horizon.moved
    rows = np.flatnonzero(oriented.oriented)
    rotation = log_rotation(stated_rotation(R[rows], "opensfm")).tolist()
    translation = translation_of(R[rows], position[rows], "opensfm").tolist()
    names, cameras = block.images.id, block.cameras.id[block.images.camera]
    shots = {
        str(names[row]): {
            "camera": str(cameras[row]),
            "rotation": r,
            "translation": t,
            **({"capture_time": float(block.images.time_s[row])} if np.isfinite(block.images.time_s[row]) else {}),
        }
        for row, r, t in zip(rows.tolist(), rotation, translation)
    }
    control = control_points(oriented)
    bound = {p.row for p in control}
    measured = [row for row in np.unique(rays.point).tolist() if row not in bound]
    points = {
        str(block.points.id[row]): {"coordinates": xyz_m[row].tolist(), "color": [255, 255, 255]}
        for row in measured
        if np.isfinite(xyz_m[row]).all()
    }
    reconstruction: dict[str, Any] = {
        "cameras": {lens.id: _camera(lens) for lens in lenses},
        "shots": shots,
        "points": points,
    }
    if horizon.reference_lla:
        reconstruction["reference_lla"] = dict(zip(("latitude", "longitude", "altitude"), horizon.reference_lla))
    scale = np.array([max(lens.size_px) for lens in lenses])[block.images.camera[rays.image]]
    xy = (rays.xy_px / scale[:, None]).tolist()
    of_ties = np.flatnonzero(~np.isin(rays.point, sorted(bound))).tolist()
    tracks = [
        f"{names[rays.image[k]]}\t{block.points.id[rays.point[k]]}\t{k}\t{xy[k][0]!r}\t{xy[k][1]!r}\t1.0\t0\t0\t0\t-1\t-1"
        for k in of_ties
    ]
    files = {"reconstruction.json": json.dumps([reconstruction], indent=1, ensure_ascii=False)}
    if tracks:
        files["tracks.csv"] = "\n".join([TRACKS, *tracks, ""])
    if control:
        marks = _marks(oriented, control, horizon, xy, reporter)
        files["ground_control_points.json"] = json.dumps({"points": marks}, indent=1, ensure_ascii=False)
    write_files(folder, files)


def _forms(lens: Lens) -> tuple[str, ...]:
    fisheye = FORMS[lens.form].family == "fisheye"
    return MODELS[2:] if fisheye else MODELS[:2]


def _camera(lens: Lens) -> dict[str, Any]:
    size, form = max(lens.size_px), FORMS[lens.form]
    fx, fy = (f / size for f in lens.focal_px)
    x, y = (c / size for c in lens.principal_point_px)
    of_two = {"focal_x": fx, "focal_y": fy, "c_x": x, "c_y": y} if form.focal_lengths == 2 else {"focal": fx}
    return {
        "projection_type": lens.form.removeprefix("opensfm-"),
        "width": int(lens.size_px[0]),
        "height": int(lens.size_px[1]),
        **of_two,
        **{name: lens.parameters.get(name, 0.0) for name in form.terms},
    }


def _marks(
    oriented: OrientedBlock, control: list[ControlPoint], horizon: Horizon, xy: list[list[float]], reporter: Reporter
) -> list[dict[str, Any]]:
    """Control and check points with where images show them."""
    of_points, names, made = oriented.rays.of_points(), oriented.block.images.id, []
    left_out, checks = [], [p.id for p in control if p.is_check]
    for p in control:
        observations = [
            {"shot_id": str(names[oriented.rays.image[k]]), "projection": xy[k]} for k in of_points.get(p.row, [])
        ]
        point: dict[str, Any] = {"id": p.id, "observations": observations}
        place = horizon.latitude_longitude_height(p.xyz_m) if p.known[0] and p.known[1] and not p.is_check else None
        if place is None:
            left_out += [] if p.is_check else [p.id]
        else:
            keys = ("latitude", "longitude", "altitude") if p.known[2] else ("latitude", "longitude")
            point["position"] = dict(zip(keys, place))
        made.append(point)
    if left_out:
        reporter.warn(f"control without latitude and longitude is written without a position: {shown(left_out)}")
    if checks:
        reporter.log(f"check points are written without a position, or they would be control: {shown(checks)}")
    return made
