"""OPF: cameras, calibrated or as given, their positions and orientations, control, marks, and the tracks.

The principal point and marks count from the upper left corner, y down; R1 R2 R3 T1 T2 are OpenCV's k1 k2 k3 p1 p2 (as
Pix4D's). orientation_deg is omega, phi, kappa of R = Rx Ry Rz, image (x right, y up) to processing system. Positions
and attitudes of captures are observed, with their standard deviations; where there are none, calibrated ones are start
values. A camera is called as its URI; the accuracy of a mark is taken as a standard deviation in pixels.

Source: the specification, github.com/Pix4D/opf-spec, versions 1.x.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.codes import APPROXIMATE_VALUE, CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.conventions.pixel_origins import PIXEL_AXES
from aatri.formats.opf.captures import (
    Attitude,
    Located,
    Projected,
    attitudes_of,
    in_scene,
    located,
    placed,
    projected_places,
    rigs_of,
    scene_of_places,
)
from aatri.formats.opf.project import PROJECT, OpfProject, SceneFrame, read_tracks
from aatri.formats.opf.writer import write_opf
from aatri.formats.parts.block_parts import PLANE, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading
from aatri.formats.text.json_text import JsonText, Key
from aatri.geometry.rotations import rotation_from_angles
from aatri.progress import SILENT, Reporter

EXPORT = "export the project again"


def read_opf(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a project.

    Raises
    ------
    InputError
        If a document is not of the specification, or names a camera, sensor or file that is not there.
    """
    project = OpfProject(path)
    name_of = _camera_list(project)
    input_cameras = project.open("input-cameras")
    if input_cameras is None:
        raise InputError("no item input_cameras, which has the sensors", where=f"{project.path}:1", remedy=EXPORT)
    sensor_of, lenses, positions = _input_cameras(input_cameras, name_of)
    attitudes, notes = attitudes_of(input_cameras, name_of)
    calibrated, control = project.open("calibrated-cameras"), project.open("input-control-points")
    stated, scene = _calibrated(calibrated, name_of), project.scene()
    if scene is None:
        scene = scene_of_places((input_cameras, "captures"), (control, "gcps"))
        if scene is not None and stated:
            notes.append("no item scene_reference_frame: the calibrated places are in a system of their own, not read")
            stated = {}
        scene = scene or SceneFrame(PLANE, np.zeros(3))
    if calibrated is not None:
        lenses |= _sensors(calibrated, {key: lens.size_px for key, lens in lenses.items()}, lenses)
    used = [lenses[key] for key in dict.fromkeys(sensor_of.values())]
    parts = BlockParts(
        "opf",
        project.files,
        name=project.name,
        frame=scene.frame,
        notes=[*project.notes, *notes],
        pixel_axes=PIXEL_AXES["opf"],
        **camera_parts(used, reporter, allowed_px=reading.lens_misfit_px),
        images={"id": [name_of[key] for key in sensor_of], "camera": [lenses[key].id for key in sensor_of.values()]},
    )
    projected = projected_places(project, scene)
    places = placed(project, positions, projected, scene, reporter)
    if (rigs := rigs_of(input_cameras, {key: lens.id for key, lens in lenses.items()}, list(sensor_of))) is not None:
        parts.images, parts.others = {**parts.images, **rigs[0]}, {"rig_members": rigs[1]}
    parts.exterior = _exterior(stated, places, scene, attitudes, project.files, reporter)
    marks = _control(project, control, parts, name_of, projected, scene, reporter)
    if "sparse" in project.resources:
        marks += read_tracks(project.resources["sparse"], name_of, project.files)
    if marks:
        columns = zip(*marks)
        parts.image_points = dict(zip(("image", "point", "xy", "sigma_px", "file", "line"), map(list, columns)))
    return parts


def _camera_list(project: OpfProject) -> dict[int, str]:
    document = project.open("camera-list")
    if document is None:
        raise InputError("no item camera_list", where=f"{project.path}:1", remedy=EXPORT)
    name_of: dict[int, str] = {}
    for k, _ in enumerate(document.get(list, "cameras")):
        key, uri = document.get(int, "cameras", k, "id"), document.get(str, "cameras", k, "uri")
        if name_of.setdefault(key, uri) != uri:
            raise document.fault(("cameras", k), f"camera {key} is {uri} and {name_of[key]}", EXPORT)
    if len({*name_of.values()}) < len(name_of):
        uris = list(name_of.values())
        twice = next(uri for k, uri in enumerate(uris) if uri in uris[:k])
        raise document.fault(("cameras",), f"{twice} is of two cameras", "give each image an id of its own")
    return name_of


def _named(document: JsonText, keys: tuple[Key, ...], name_of: dict[int, str]) -> str:
    """The image of a camera id."""
    key = document.get(int, *keys)
    if key not in name_of:
        raise document.fault(keys, f"camera {key} is not in the list of cameras", EXPORT)
    return name_of[key]


def _input_cameras(
    document: JsonText, name_of: dict[int, str]
) -> tuple[dict[int, int], dict[int, Lens], list[Located]]:
    """The sensor of each camera, the sensors as given, and the positions of captures."""
    sizes: dict[int, tuple[float, float]] = {}
    for k, _ in enumerate(document.get(list, "sensors")):
        width, height = document.numbers("sensors", k, "image_size_px", count=2)
        sizes[document.get(int, "sensors", k, "id")] = (width, height)
    sensor_of: dict[int, int] = {}
    positions = []
    if not document.get(list, "captures"):
        raise document.fault(("captures",), "no captures", EXPORT)
    for i, capture in enumerate(document.get(list, "captures")):
        for j, _ in enumerate(document.get(list, "captures", i, "cameras")):
            keys: tuple[Key, ...] = ("captures", i, "cameras", j)
            key, sensor = document.get(int, *keys, "id"), document.get(int, *keys, "sensor_id")
            _named(document, (*keys, "id"), name_of)
            if sensor not in sizes:
                raise document.fault(keys, f"sensor {sensor} is not there", EXPORT)
            if sensor_of.setdefault(key, sensor) != sensor or key in list(sensor_of)[:-1]:
                raise document.fault(keys, f"camera {key} twice among the captures", "remove one")
        if "geolocation" in capture:
            name = _named(document, ("captures", i, "reference_camera_id"), name_of)
            key = document.get(int, "captures", i, "id")
            positions.append(located(document, ("captures", i, "geolocation"), name, key))
    return sensor_of, _sensors(document, sizes, {}, {*sensor_of.values()}), positions


def _sensors(
    document: JsonText, sizes: dict[int, tuple[float, float]], before: dict[int, Lens], used: Any = None
) -> dict[int, Lens]:
    """The perspective sensors of a document; another that a camera is of is refused."""
    lenses: dict[int, Lens] = {}
    for k, _ in enumerate(document.get(list, "sensors")):
        keys: tuple[Key, ...] = ("sensors", k, "internals")
        key = document.get(int, "sensors", k, "id")
        if key not in (before if used is None else used):
            continue
        if (kind := document.get(str, *keys, "type")) != "perspective":
            what = f"sensor {key} is of the type {kind!r}, which has no like here"
            raise document.fault((*keys, "type"), what, "perspective ones are read")
        if key in lenses:
            raise document.fault(("sensors", k), f"sensor {key} twice", "remove one")
        f, (x, y) = (
            document.get(float, *keys, "focal_length_px"),
            document.numbers(*keys, "principal_point_px", count=2),
        )
        radial = document.numbers(*keys, "radial_distortion", count=3)
        values = [*radial, *document.numbers(*keys, "tangential_distortion", count=2)]
        width, height = sizes[key]
        name = before[key].id if before else f"{document.get(str, 'sensors', k, 'name', default='sensor')} {key}"
        where = document.where(*keys)
        parameters = dict(zip(("R1", "R2", "R3", "T1", "T2"), values))
        lenses[key] = Lens(
            name, "opf", (width, height), (f, f), (x - width / 2, y - height / 2), parameters, where=where
        )
    return lenses


def _calibrated(document: JsonText | None, name_of: dict[int, str]) -> dict[str, tuple[list[float], list[float]]]:
    """Calibrated places and angles of the images, as they stand."""
    stated: dict[str, tuple[list[float], list[float]]] = {}
    for k, _ in enumerate(document.get(list, "cameras") if document is not None else ()):
        assert document is not None
        name = _named(document, ("cameras", k, "id"), name_of)
        if name in stated:
            raise document.fault(("cameras", k), f"the camera of {name} twice", "remove one")
        place, angles = (document.numbers("cameras", k, key, count=3) for key in ("position", "orientation_deg"))
        stated[name] = place, angles
    return stated


def _exterior(
    stated: dict[str, tuple[list[float], list[float]]],
    observed: dict[str, tuple[Float, Float]],
    scene: SceneFrame,
    attitudes: dict[str, Attitude],
    files: list[Path],
    reporter: Reporter,
) -> dict[str, Any]:
    """Observed positions and attitudes, calibrated ones where there are none."""
    names = list(dict.fromkeys([*stated, *observed, *attitudes]))
    if not names:
        return {}
    nowhere = [np.nan] * 3
    position = np.array([stated[n][0] if n in stated else nowhere for n in names]) - scene.shift_m
    R = rotation_from_angles(np.radians([stated[n][1] if n in stated else nowhere for n in names]))
    unknown = np.full((3, 3), np.nan)
    for k, name in enumerate(names):
        position[k] = observed[name][0] if name in observed else position[k]
    turned = in_scene(attitudes, dict(zip(names, position)), scene, files, reporter)
    exterior: dict[str, Any] = {
        "image": names,
        "position_m": position,
        "position_covariance_m2": np.array([observed[n][1] if n in observed else unknown for n in names]),
        "position_use": [OBSERVED_VALUE if n in observed else APPROXIMATE_VALUE for n in names],
        "ground_from_image": np.array([turned.get(n, R[k]) for k, n in enumerate(names)]),
    }
    if attitudes:
        sigma = [attitudes[n].sigma_rad if n in attitudes else np.full(3, np.nan) for n in names]
        use = [OBSERVED_VALUE if n in attitudes else APPROXIMATE_VALUE for n in names]
        exterior |= {"angle_sigma_rad": np.array(sigma), "angle_use": use}
    return exterior


def _control(
    project: OpfProject,
    document: JsonText | None,
    parts: BlockParts,
    name_of: dict[int, str],
    projected: Projected,
    scene: SceneFrame,
    reporter: Reporter,
) -> list[tuple[Any, ...]]:
    """Control and check points to the parts; the marks of these and of tie points."""
    if document is None:
        return []
    file, points, marks = project.files.index(document.path), list[Located](), list[tuple[Any, ...]]()
    roles, lines, first = list[int](), list[int](), dict[str, int]()
    for table in ("gcps", "mtps"):
        document.get(list, table)
        for k, line in enumerate(document.lines(table).values()):
            keys: tuple[Key, ...] = (table, k)
            point = document.get(str, *keys, "id")
            if first.setdefault(point, line) != line:
                raise document.fault(keys, f"point {point} twice, first in line {first[point]}", "remove one")
            if table == "gcps":
                points.append(located(document, (*keys, "geolocation"), point, point))
                is_check = document.get(dict, *keys).get("is_checkpoint")
                if not isinstance(is_check, bool):
                    raise document.fault(keys, f"point {point} does not say whether it is_checkpoint", EXPORT)
                roles.append(CHECK if is_check else CONTROL)
                lines.append(line)
            for j, _ in enumerate(document.get(list, *keys, "marks")):
                at: tuple[Key, ...] = (*keys, "marks", j)
                accuracy = document.get(float, *at, "accuracy")
                if accuracy <= 0:
                    raise document.fault(at, f"accuracy {accuracy:g} of a mark", "it is positive")
                xy = document.numbers(*at, "position_px", count=2)
                image = _named(document, (*at, "camera_id"), name_of)
                marks.append((image, point, xy, [accuracy] * 2, file, line))
    if points:
        at_place = placed(project, points, projected, scene, reporter)
        parts.ground_points = {
            "point": [p.name for p in points],
            "xyz_m": np.array([at_place[p.name][0] for p in points]),
            "covariance_m2": np.array([at_place[p.name][1] for p in points]),
            "role": np.repeat(np.array(roles)[:, None], 3, axis=1),
            "file": file,
            "line": lines,
        }
    return marks


_STATED = re.compile(rf'"format"\s*:\s*"{re.escape(PROJECT)}"')  # the schema of OPF has the words elsewhere


def _recognised(view: FileView) -> str:
    if not view.is_folder:
        return f"JSON of the format {PROJECT}" if _STATED.search(view.head[:4096]) else ""
    return next((name for name in view.names if name.endswith(".opf") and _recognised(view.of(name))), "")


def _files(view: FileView) -> list[Path]:
    return [p for p in view.path.rglob("*") if p.is_file()] if view.is_folder else [view.path]


OPF = Format(
    "opf", "OPF project", _recognised, f"`project.opf`, JSON of the format {PROJECT}",
    carries=("cameras", "distortion", "image points", "control", "check points", "positions", "attitudes",
             "start orientations", "frame", "standard deviations", "rigs"),
    page="docs/formats.md#opf", read=read_opf, files_of=_files, write=write_opf,
    written=("cameras", "distortion", "image points", "control", "check points", "start values of points", "positions",
             "start orientations", "frame", "standard deviations"),
    estimates_cameras=True,
)  # fmt: skip
