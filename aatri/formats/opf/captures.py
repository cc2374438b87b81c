"""Attitudes, rigs and places of OPF's captures.

omega, phi, kappa of a capture are R = Rx Ry Rz, image (right, top, back) to the axes of a map of their own, with
standard deviations: observed. Yaw, pitch, roll are not read: the specification has right, top, back of the image become
east, north, down at 0 0 0, which no rotation does.

A secondary camera s is mounted on the reference camera r of its capture, image axes right, down, front:

    T_s = T_r + R_r T_rel,    R_s = R_r R_rel,    R_rel = Rx Ry Rz

The mounting as given is observed, with its standard deviations; what a calibration has made of it is not read.

Source: pix4d.github.io/opf-spec, Input cameras; Auxiliary objects, Rig relatives.

Places, of captures and of control, are stated in systems of their own and as the project has projected them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block_tables import RigMembers
from aatri.formats.conventions.poses import Y_UP
from aatri.formats.opf.project import OpfProject, SceneFrame, frame_of
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.one_frame import in_frame
from aatri.formats.text.json_text import JsonText, Key
from aatri.frames.conversion import Frame, crs_of
from aatri.frames.own_map import utm_of
from aatri.geometry.rotations import rotation_from_angles
from aatri.ids import several, shown
from aatri.progress import Reporter

Projected = dict[int | str, tuple[Float, Float]]
"""Places of captures and control in the frame of the scene with their covariances, by their ids."""

OPK, YPR = "omega_phi_kappa", "yaw_pitch_roll"


class Located(NamedTuple):
    """A place in a frame of its own: X Y Z, standard deviations in m; `key` is what the project calls it."""

    name: str
    key: int | str
    frame: Frame
    xyz: list[float]
    sigma_m: list[float]


def located(document: JsonText, keys: tuple[Key, ...], name: str, key: int | str) -> Located:
    frame, undulation_m = frame_of(document, (*keys, "crs"))
    xyz, sigma = document.numbers(*keys, "coordinates", count=3), document.numbers(*keys, "sigmas", count=3)
    if min(sigma) < 0:
        raise document.fault((*keys, "sigmas"), f"standard deviations {sigma} of {name}", "they are positive, in m")
    return Located(name, key, frame, [*xyz[:2], xyz[2] + undulation_m], sigma)


def placed(
    project: OpfProject, stated: Sequence[Located], projected: Projected, scene: SceneFrame, reporter: Reporter
) -> dict[str, tuple[Float, Float]]:
    """Places in the frame of the scene with their covariances, m: as the project has projected them, else converted."""
    placed = {place.name: projected[place.key] for place in stated if place.key in projected}
    open_ = [place for place in stated if place.key not in projected]
    for frame in dict.fromkeys(place.frame for place in open_):
        own = [place for place in open_ if place.frame == frame]
        rows = {"point": [p.name for p in own], "xyz_m": [p.xyz for p in own], "sigma_m": [p.sigma_m for p in own]}
        parts = in_frame(BlockParts("opf", project.files, frame=frame, ground_points=rows), scene.frame, reporter)
        xyz = np.asarray(parts.ground_points["xyz_m"])
        covariance = parts.ground_points.get("covariance_m2")
        if covariance is None:
            covariance = np.array([np.diag(np.square(p.sigma_m)) for p in own])
        placed |= {p.name: (xyz[k], covariance[k]) for k, p in enumerate(own)}
    return placed


def scene_of_places(*tables: tuple[JsonText | None, str]) -> SceneFrame | None:
    """The map of the first geolocation, of a project without a scene; the UTM zone where that is in degrees."""
    for document, table in tables:
        for k in range(len(document.get(list, table)) if document is not None else 0):
            assert document is not None
            if "geolocation" not in document.get(dict, table, k):
                continue
            place = located(document, (table, k, "geolocation"), "", k)
            if not place.frame.geographic:
                east_first = ("x", "y", "z") if "x" in place.frame.axes else ("east", "north", "up")
                return SceneFrame(replace(place.frame, axes=east_first), np.zeros(3))
            at, parts = dict(zip(place.frame.axes, place.xyz)), crs_of(place.frame).sub_crs_list
            own = utm_of(place.frame, at["latitude"], at["longitude"])
            return SceneFrame(replace(own, vertical=parts[1].to_wkt() if parts else ""), np.zeros(3))
    return None


def projected_places(project: OpfProject, scene: SceneFrame) -> Projected:
    """Captures and control in the processing system, by their ids, in the frame of the scene."""
    projected: Projected = {}
    for resource, table, inner, column, kind in (
        ("projected-input-cameras", "captures", ("geolocation",), "position", int),
        ("projected-control-points", "projected_gcps", (), "coordinates", str),
    ):
        document = project.open(resource)
        for k in range(len(document.get(list, table)) if document is not None else 0):
            assert document is not None
            if all(key in document.get(dict, table, k) for key in inner):
                xyz, sigma = (document.numbers(table, k, *inner, c, count=3) for c in (column, "sigmas"))
                key = document.get(kind, table, k, "id")
                projected[key] = (np.array(xyz) - scene.shift_m, np.diag(np.square(sigma)))
    return projected


class Attitude(NamedTuple):
    """An attitude: image to the axes of the map `crs`, and standard deviations of omega, phi, kappa."""

    crs: str
    ground_from_image: Float
    sigma_rad: Float
    where: str


def attitudes_of(document: JsonText, name_of: Mapping[int, str]) -> tuple[dict[str, Attitude], list[str]]:
    """Attitudes of the reference cameras by their images, and a note on those that are not read.

    Raises
    ------
    InputError
        If an attitude is not of the specification.
    """
    attitudes, unread = dict[str, Attitude](), list[str]()
    for k, capture in enumerate(document.get(list, "captures")):
        if "orientation" not in capture:
            continue
        keys: tuple[Key, ...] = ("captures", k, "orientation")
        kind, camera = document.get(str, *keys, "type"), document.get(int, "captures", k, "reference_camera_id")
        if kind not in (OPK, YPR):
            raise document.fault(keys, f"an orientation of the type {kind!r}", f"types are {OPK}, {YPR}")
        if kind == YPR or camera not in name_of:
            unread.append(str(capture.get("id")))
            continue
        angles, sigma = (np.radians(document.numbers(*keys, name, count=3)) for name in ("angles_deg", "sigmas_deg"))
        if sigma.min() <= 0:
            raise document.fault((*keys, "sigmas_deg"), f"standard deviations {np.degrees(sigma)}", "they are positive")
        crs = document.get(str, *keys, "crs")
        attitudes[name_of[camera]] = Attitude(crs, rotation_from_angles(angles), sigma, document.where(*keys))
    what = f"yaw, pitch, roll of {several(len(unread), 'capture')} are not read: {shown(unread)}"
    return attitudes, [what] if unread else []


def in_scene(attitudes: Mapping[str, Attitude], position_m: Mapping[str, Float], scene: SceneFrame,
             files: list[Path], reporter: Reporter) -> dict[str, Float]:  # fmt: skip
    """Rotations to the axes of the scene; NaN of an image in another system whose place is not known.

    Raises
    ------
    InputError
        If a system is not understood.
    """
    turned = {name: a.ground_from_image for name, a in attitudes.items()}
    for crs in dict.fromkeys(a.crs for a in attitudes.values() if a.crs != scene.frame.crs):
        own = Frame("attitudes", ("east", "north", "up"), crs)
        names = [name for name, a in attitudes.items() if a.crs == crs]
        at: dict[str, Any] = {"image": names, "position_m": [position_m.get(n, np.full(3, np.nan)) for n in names]}
        parts = in_frame(BlockParts("opf", files, frame=scene.frame, exterior=at), own, reporter)
        at = {**parts.exterior, "ground_from_image": np.array([turned[name] for name in names])}
        moved = in_frame(BlockParts("opf", files, frame=own, exterior=at), scene.frame, reporter)
        turned |= dict(zip(names, np.asarray(moved.exterior["ground_from_image"])))
    return turned


def rigs_of(
    document: JsonText, camera_of: Mapping[int, str], images: list[int]
) -> tuple[dict[str, list[Any]], RigMembers] | None:
    """Columns rig, member and sequence of the images, and the members; None of a project without rigs.

    Parameters
    ----------
    document : JsonText
        Input cameras.
    camera_of : mapping of int to str
        Cameras of the block by ids of sensors.
    images : list of int
        Ids of the images, in the order of the block.

    Raises
    ------
    InputError
        If a mounting is not of the specification.
    """
    at = {document.get(int, "sensors", k, "id"): k for k, _ in enumerate(document.get(list, "sensors"))}
    mounted = {key for key, k in at.items() if "rig_relatives" in document.get(dict, "sensors", k)}
    of_image: dict[int, tuple[str, str, float]] = {}
    members: dict[tuple[str, str], int | None] = {}
    for k, capture in enumerate(document.get(list, "captures")):
        sensor_of = {camera["id"]: camera["sensor_id"] for camera in capture["cameras"]}
        reference = sensor_of.get(document.get(int, "captures", k, "reference_camera_id"))
        others = {*sensor_of.values()} - {reference}
        if reference is None or not others or not others <= mounted or len({*sensor_of.values()}) < len(sensor_of):
            continue
        rig = camera_of[reference]
        members[rig, rig] = None
        for image, sensor in sensor_of.items():
            of_image[image] = (rig, camera_of[sensor], float(k + 1))
            if sensor != reference:
                members[rig, camera_of[sensor]] = at[sensor]
    if not of_image:
        return None
    columns = zip(*(of_image.get(image, ("", "", np.nan)) for image in images))
    return dict(zip(("rig", "member", "sequence"), map(list, columns))), _members(document, members)


def _members(document: JsonText, members: Mapping[tuple[str, str], int | None]) -> RigMembers:
    """The mountings in image axes right, up, back: D Rx Ry Rz D with D = diag(1, -1, -1) turns the last two signs."""
    ordered = sorted(members, key=lambda pair: (pair[0], pair[0] != pair[1], pair[1]))
    values = np.zeros((4, len(ordered), 3))
    for row, pair in enumerate(ordered):
        if (sensor := members[pair]) is None:
            continue
        for k, (part, names) in enumerate(
            (("translation", ("values_m", "sigmas_m")), ("rotation", ("angles_deg", "sigmas_deg")))
        ):
            for j, name in enumerate(names):
                keys: tuple[Key, ...] = ("sensors", sensor, "rig_relatives", part, name)
                values[2 * k + j, row] = document.numbers(*keys, count=3)
                if j and values[2 * k + j, row].min() < 0:
                    raise document.fault(keys, f"standard deviations {values[2 * k + j, row]}", "they are positive")
    return RigMembers.of(
        rig=[rig for rig, _ in ordered],
        member=[member for _, member in ordered],
        is_frame=[rig == member for rig, member in ordered],
        position_m=values[0] * Y_UP,
        angles_rad=np.radians(values[2]) * Y_UP,
        position_sigma_m=values[1],
        position_free=False,
        angle_sigma_rad=np.radians(values[3]),
        angle_free=False,
    )
