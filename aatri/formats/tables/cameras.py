"""Cameras and rigs of block.yaml as tables, and what images.csv says of rigs.

Images of one rig with the same time, or else the same strip and sequence, are one exposure: it has each member once.
"""

from typing import NamedTuple

import numpy as np

from aatri.artifacts.block import CameraParameters, Cameras, DistortionTable, Fiducials, RigMembers
from aatri.formats.tables.settings.camera import VECTORS, CameraSettings
from aatri.formats.tables.source import Source, ask_for_angle_unit, look_up, plain_angle_rad
from aatri.formats.text.csv_table import CsvTable
from aatri.ids import canonical, clipped, did_you_mean, is_valid


def rig_member_table(source: Source) -> RigMembers:
    """Members of the rigs: by rig, its frame first, then by member."""
    rigs = source.settings.rigs
    listed = []
    for rig in canonical(rigs):
        first, *others = rigs[rig]
        listed += [(rig, name, name == first, rigs[rig][name]) for name in (first, *canonical(others))]
        if any(any(m.angles) or any(0 < s < np.inf for s in m.sigmas.angles) for m in rigs[rig].values()):
            ask_for_angle_unit(source, "a rig has angles", "rigs", rig)
    unit, members = plain_angle_rad(source), [m for *_, m in listed]
    position_sigma = np.array([m.sigmas.position for m in members], float)
    angle_sigma = np.array([m.sigmas.angles for m in members], float)
    return RigMembers.of(
        rig=[rig for rig, *_ in listed],
        member=[name for _, name, *_ in listed],
        is_frame=[first for *_, first, _ in listed],
        position_m=[m.position for m in members],
        angles_rad=np.array([m.angles for m in members], float) * unit,
        position_sigma_m=np.where(np.isinf(position_sigma), np.nan, position_sigma),
        position_free=np.isinf(position_sigma),
        angle_sigma_rad=np.where(np.isinf(angle_sigma), np.nan, angle_sigma) * unit,
        angle_free=np.isinf(angle_sigma),
    )


def check_rigs_of_images(source: Source, table: CsvTable) -> None:
    """Faults of the columns rig and member of images.csv."""
    rigs = source.settings.rigs
    rig, member = table.text["rig"], table.text["member"]
    if not any(rig) and not any(member):
        return
    look_up(table, "rig", {name: k for k, name in enumerate(rigs)}, "rig", "add it to `rigs` in block.yaml")
    table.complain(
        [k for k, name in enumerate(rig) if bool(name) != bool(member[k])],
        "rig",
        "rig is {}: an image has both rig and member, or none",
        "fill in the other column",
    )
    for k, name in enumerate(member):
        members = rigs.get(rig[k], {})
        if name and members and name not in members:
            what = f"rig {clipped(rig[k])} has no member {clipped(name)!r}{did_you_mean(name, members)}"
            table.problems.add(what, table.where(k, "member"), "add it to the rig in block.yaml")
    first: dict[tuple[str, str, object], int] = {}
    for k, name in enumerate(rig):
        if not name or not member[k]:
            continue
        exposure = _exposure(table, k)
        if exposure is None:
            table.complain(
                [k],
                "rig",
                "an image of rig {} needs time, or strip and sequence",
                "they say which images are one exposure",
            )
            continue
        earlier = first.setdefault((name, member[k], exposure), k)
        if earlier != k:
            what = f"member {clipped(member[k])} of rig {clipped(name)} twice in one exposure, first in line"
            table.complain([k], "member", f"{what} {table.line[earlier]}", "mend time, strip or sequence")


def _exposure(table: CsvTable, k: int) -> object | None:
    """What images of one exposure have in common; None if the row does not say."""
    time, sequence = float(table.number["time"][k]), float(table.number["sequence"][k])
    if np.isfinite(time):
        return time
    return (table.text["strip"][k], sequence) if table.text["strip"][k] and np.isfinite(sequence) else None


class CameraTables(NamedTuple):
    """The tables that describe cameras."""

    cameras: Cameras
    camera_parameters: CameraParameters
    distortion_table: DistortionTable
    fiducials: Fiducials


def camera_tables(source: Source) -> CameraTables:
    """Cameras in canonical order, with parameters, distortion tables and fiducials."""
    settings = source.settings.cameras
    ids = canonical(settings)
    cameras = [settings[name] for name in ids]
    return CameraTables(
        _cameras(source, ids, cameras),
        _parameters(source, cameras),
        _distortion(cameras),
        _fiducials(source, ids, cameras),
    )


def _cameras(source: Source, ids: list[str], cameras: list[CameraSettings]) -> Cameras:
    unknown = [np.nan, np.nan]
    for name, camera in zip(ids, cameras):
        if any(camera.boresight) or _has_unit(camera.sigmas.get("boresight", 0.0)):
            ask_for_angle_unit(source, "a boresight is given", "cameras", name)
    return Cameras.of(
        id=ids,
        kind=[c.kind for c in cameras],
        image_coordinates=[c.image_coordinates for c in cameras],
        pixel_size_mm=[c.pixel.size if c.pixel else unknown for c in cameras],
        pixel_origin=[(c.pixel.origin or "") if c.pixel else "" for c in cameras],
        pixel_y=[(c.pixel.y or "") if c.pixel else "" for c in cameras],
        format=[c.format or unknown for c in cameras],
        principal_distance_mm=[c.principal_distance for c in cameras],
        principal_point_mm=[c.principal_point for c in cameras],
        symmetry_point_mm=[c.symmetry_point for c in cameras],
        distortion=[c.distortion.model for c in cameras],
        lever_arm_m=[c.lever_arm for c in cameras],
        boresight_rad=np.array([c.boresight for c in cameras]) * plain_angle_rad(source),
        mount_deg=[c.mount for c in cameras],
    )


def _has_unit(sigma: float | list[float]) -> bool:
    """Whether a standard deviation is a figure: 0 and infinity are so in every unit."""
    return any(0 < s < np.inf for s in (sigma if isinstance(sigma, list) else [sigma]))


def _parameters(source: Source, cameras: list[CameraSettings]) -> CameraParameters:
    """One row per distortion parameter or given standard deviation, by camera and name."""
    rows = []
    for k, settings in enumerate(cameras):
        sigmas: dict[str, float] = {}
        for parameter, stated in settings.sigmas.items():
            if parameter in VECTORS:
                listed = stated if isinstance(stated, list) else [stated] * len(VECTORS[parameter])
                unit = plain_angle_rad(source) if parameter == "boresight" else 1.0
                sigmas |= {f"{parameter}.{axis}": s * unit for axis, s in zip(VECTORS[parameter], listed)}
            else:
                sigmas[parameter] = stated[0] if isinstance(stated, list) else stated
        for parameter in sorted({*sigmas, *settings.distortion.parameters}):
            s = sigmas.get(parameter, np.nan)
            start = settings.distortion.parameters.get(parameter, np.nan)
            rows.append((k, parameter, start, np.nan if np.isinf(s) else s, bool(np.isinf(s))))
    camera, name, value, sigma, free = zip(*rows) if rows else [()] * 5
    return CameraParameters.of(camera=camera, name=name, value=value, sigma=sigma, free=free)


def _distortion(cameras: list[CameraSettings]) -> DistortionTable:
    counts = [len(c.distortion.radius) for c in cameras]
    correction_um = [v for c in cameras for v in c.distortion.correction]
    return DistortionTable.of(
        camera=np.repeat(np.arange(len(cameras)), counts),
        radius_mm=[r for c in cameras for r in c.distortion.radius],
        correction_mm=np.array(correction_um) * 1e-3,
    )


def _fiducials(source: Source, ids: list[str], cameras: list[CameraSettings]) -> Fiducials:
    marks = [
        (k, mark, xy) for k, c in enumerate(cameras) for mark in canonical(c.fiducials) for xy in [c.fiducials[mark]]
    ]
    for k, mark, _ in marks:
        if not is_valid(mark):
            where = source.document.where_key("cameras", ids[k], "fiducials", mark)
            source.problems.add(f"fiducial {clipped(mark)!r} is no id", where)
    camera, mark_ids, xy_mm = zip(*marks) if marks else [()] * 3
    return Fiducials.of(camera=camera, id=mark_ids, xy_mm=xy_mm)
