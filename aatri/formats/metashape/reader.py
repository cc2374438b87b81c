"""Reading of Metashape's cameras and markers XML, and of the document of a `.psz`.

The pose of a camera is `transform`, camera (x right, y down, z forward) to chunk; that of the chunk, or of its
component, is X = s R x + T: geocentric on the datum of `reference`, or in its plane where that is local. A slave of a
rig starts from the pose of its master and the mounting of its sensor. Markers that are enabled are control, others with
coordinates check points; of their places in the images those that are pinned are measured, the rest are projections of
Metashape's own and are left out. Positions of cameras are observed where their reference is enabled, with its accuracy
or that of the settings. Yaw, pitch and roll of a reference are the start orientation of an image that is not aligned:
R = Rz(-yaw) Rx(pitch) Ry(roll), x right, y up, to east, north, up, as matrices that Metashape's ypr2mat has printed.
All comes out in the map of the reference; where that is in degrees, in the UTM zone of its middle.

Source: documents of versions 1.2, 1.4 and 2.0; Agisoft Metashape user manual.
"""

import re
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.codes import CHECK, CONTROL, NO_ROLE
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.conventions.pixel_origins import PIXEL_AXES, PIXEL_MM
from aatri.formats.conventions.poses import ground_from_image, is_rotation
from aatri.formats.metashape.cameras import ImageElement, Sensor, attitudes_of, cameras_of, lens_of, rigs_of, sensors_of
from aatri.formats.metashape.chunk_frame import ChunkFrame, frame_of_chunk
from aatri.formats.metashape.tie_points import TiePoints, tie_points_of
from aatri.formats.metashape.writer import write_metashape
from aatri.formats.parts.block_parts import BlockParts, rows_of, together
from aatri.formats.parts.format import AS_IT_SAYS, FileView, Format, Reading
from aatri.formats.text.archive import Archive
from aatri.formats.text.text_line import check_positive, once, places
from aatri.formats.text.xml_tree import XmlElement, decoded_xml, read_xml
from aatri.ids import clipped, several, shown
from aatri.progress import SILENT, Reporter

WANTED = "cameras or markers of Metashape as XML, or a .psz"
DOCUMENT = "doc.xml"
ENABLED = ("true", "1")


def read_metashape(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a document.

    Raises
    ------
    InputError
        If it is not of this form, or has what is not supported; the message names line and element.
    """
    archive = Archive(path) if DOCUMENT in FileView(path).names else None
    root = _root(path, archive)
    if root.tag == "calibration":
        return _calibration(root, path, reading, reporter)
    chunk, others = _chunk(root)
    cameras, disabled = cameras_of(chunk)
    sensors = sensors_of(chunk, {camera.sensor for camera in cameras})
    lenses = [sensor.lens for sensor in sensors.values() if sensor.lens is not None]
    parts = BlockParts(
        "metashape",
        [path],
        name=path.stem,
        pixel_axes=PIXEL_AXES["metashape"],
        **camera_parts(lenses, reporter, allowed_px=reading.lens_misfit_px),
    )
    if others:
        parts.notes.append(
            f"{several(len(others), 'chunk', 'is', 'are')} not enabled, or empty, and left out: {shown(others)}"
        )
    if disabled:
        parts.notes.append(
            f"{several(len(disabled), 'image', 'is', 'are')} not enabled and left out: {shown(disabled)}"
        )
    if cameras:
        named = {key: s.name for key, s in sensors.items() if s.lens is not None}
        parts.images = {
            "id": [c.name for c in cameras],
            "camera": [named.get(c.sensor, "") for c in cameras],
            **places([c.at for c in cameras], [path]),
        }
    frame = frame_of_chunk(chunk)
    settings = _settings(chunk)
    poses = _poses(cameras, sensors, frame)
    references = _references(cameras, settings.get("accuracy_cameras", np.nan))
    markers = chunk.all("markers")[0].within("marker") if chunk.all("markers") else iter(())
    targets, point_names = _targets(list(markers), settings.get("accuracy_markers", np.nan))
    names = {c.id: c.name for c in cameras}
    ties = None if archive is None else tie_points_of(archive, chunk, names)
    frame.give(parts, poses, (references, attitudes_of(cameras)), targets, ties, reporter)
    _give_marks(parts, chunk, names, point_names, settings)
    if ties is not None:
        _give_ties(parts, ties, settings.get("accuracy_tiepoints", np.nan))
    rigs = rigs_of(cameras, sensors, frame.transform("")[1])
    if rigs is not None:
        parts.images, parts.others = {**parts.images, **rigs[0]}, {"rig_members": rigs[1]}
        parts.notes.append(f"rigs: {shown(np.unique(rigs[1].rig).tolist())}; their mounts start from Metashape's, free")
    parts.notes += _not_read(chunk, cameras, {camera.name for camera in poses[0]})
    return parts


def _not_read(chunk: XmlElement, cameras: list[ImageElement], aligned: Collection[str]) -> list[str]:
    """Notes on what is in the document and no part of the block."""
    notes = []
    if turned := [name for name in attitudes_of(cameras) if name in aligned]:
        notes.append(f"yaw, pitch, roll of {several(len(turned), 'aligned image')} are not read: {shown(turned)}")
    sensors = [s.get("label") or s.get("id") for s in chunk.all("sensors", "sensor") if any(s.within("covariance"))]
    posed = [c.name for c in cameras if c.at.all("location_covariance") or c.at.all("rotation_covariance")]
    for what, names in (("camera", sensors), ("orientation", posed)):
        if names:
            notes.append(
                f"covariances of {several(len(names), what)} are Metashape's results of the same measurements: "
                f"not read, so that nothing counts twice: {shown(names)}"
            )
    if bars := [bar.get("label") or bar.get("id") for bar in chunk.all("scalebars", "scalebar")]:
        notes.append(
            f"{several(len(bars), 'scale bar', 'is', 'are')} not read: {shown(bars)}; give distances as "
            "relative control"
        )
    return notes


def _calibration(root: XmlElement, path: Path, reading: Reading, reporter: Reporter) -> BlockParts:
    """The camera of a calibration file (Tools, Camera Calibration, Save); it is called as the file."""
    size = (root.number("width"), root.number("height"))
    lens = lens_of(root, path.stem, root.one("projection").text, size, PIXEL_MM)
    cameras = camera_parts([lens], reporter, allowed_px=reading.lens_misfit_px)
    return BlockParts("metashape", [path], name=path.stem, pixel_axes=PIXEL_AXES["metashape"], **cameras)


def _root(path: Path, archive: Archive | None) -> XmlElement:
    if archive is None:
        return read_xml(path, ("document", "calibration"), WANTED)
    return read_xml(path, ("document",), WANTED, decoded_xml(archive.bytes_of(DOCUMENT), archive.at(DOCUMENT)))


def _chunk(root: XmlElement) -> tuple[XmlElement, list[str]]:
    """The chunk that is enabled and not empty, and the labels of the others."""
    every = [*root.all("chunk"), *root.all("chunks", "chunk")]
    chunks = [c for c in every if c.get("enabled", "true") in ENABLED] or every
    chunks = [c for c in chunks if any(e.children for kind in ("cameras", "markers") for e in c.all(kind))] or chunks
    if len(chunks) > 1:
        names = shown([c.get("label", "?") for c in chunks])
        remedy = 'a block is one: disable the others in Metashape, or enabled="false" in their <chunk>'
        raise chunks[1].error(f"{len(chunks)} chunks: {names}", remedy)
    if not chunks or not (chunks[0].all("cameras") or chunks[0].all("markers")):
        what = "no chunk with cameras or markers"
        if root.get("path"):
            what = f"a pointer to {clipped(root.get('path'))}, {what}"
        raise root.error(what, "export the cameras and the markers as XML, or save the project as .psz")
    return chunks[0], [c.get("label", "?") for c in every if c is not chunks[0]]


def _settings(chunk: XmlElement) -> dict[str, float]:
    """Accuracies of the settings, by name."""
    properties = [*chunk.all("settings", "property"), *chunk.all("property")]
    return {
        p.get("name"): p.parsed(p.get("value"), p.get("name"))
        for p in properties
        if p.get("name").startswith("accuracy_") and p.get("name") != "accuracy_cameras_ypr"
    }


def _poses(
    cameras: list[ImageElement], sensors: dict[str, Sensor], frame: ChunkFrame
) -> tuple[list[ImageElement], Float, Float]:
    """Images that are aligned, their positions in the world of the chunk (n, 3), and rotations (n, 3, 3)."""
    transforms = {c.id: c.at.one("transform").numbers(16).reshape(4, 4) for c in cameras if c.at.all("transform")}
    aligned, position, rotation = [], list[Float](), list[Float]()
    for camera in cameras:
        own = transforms.get(camera.id)
        sensor = sensors.get(camera.sensor)
        if own is None and camera.master in transforms and camera.master != camera.id and sensor is not None:
            mounting = np.eye(4)
            mounting[:3, :3], mounting[:3, 3] = sensor.rotation, sensor.translation
            own = transforms[camera.master] @ mounting
        if own is None:
            continue
        if not is_rotation(own[:3, :3]):
            raise camera.at.error(f"the transform of {clipped(camera.name)} is no rotation", "export it again")
        R, scale, origin = frame.transform(camera.at.get("component_id"))
        aligned.append(camera)
        position.append(scale * R @ own[:3, 3] + origin)
        rotation.append(R @ own[:3, :3])
    R_world = np.array(rotation).reshape(-1, 3, 3)
    return aligned, np.array(position).reshape(-1, 3), ground_from_image(R_world, "metashape")


def _reference(element: XmlElement, default: float) -> tuple[list[float], list[float]] | None:
    """Coordinates, NaN where one is not given, and standard deviations of a reference; None where it has none."""
    stated = element.optional("reference")
    if stated is None or not any(stated.get(axis) for axis in "xyz"):
        return None
    xyz = [stated.parsed(stated.get(axis), axis) if stated.get(axis) else np.nan for axis in "xyz"]
    every, plan = stated.get("sxyz"), stated.get("sxy")
    texts = [stated.get("sx") or plan or every, stated.get("sy") or plan or every, stated.get("sz") or every]
    sigma = [stated.parsed(text, "accuracy") if text else default for text in texts]
    check_positive(stated, sigma)
    return xyz, sigma


def _references(cameras: list[ImageElement], default: float) -> list[tuple[ImageElement, list[float], list[float]]]:
    """Observed positions: image, coordinates, standard deviations."""
    rows = []
    for camera in cameras:
        stated, enabled = _reference(camera.at, default), camera.at.optional("reference")
        if stated is not None and enabled is not None and enabled.get("enabled", "true") in ENABLED:
            if not np.isfinite(stated[0]).all():
                raise enabled.error(f"the position of {clipped(camera.name)} lacks a coordinate", "give x, y and z")
            rows.append((camera, *stated))
    return rows


def _targets(markers: list[XmlElement], default: float) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Control and check points, and the names of all markers by their ids."""
    targets, names, first = [], dict[str, str](), dict[str, XmlElement]()
    for marker in markers:
        name, number = marker.get("label") or f"marker {marker.get('id')}", marker.get("id")
        for key in (f"id {number}", name):
            once(marker, key, first, "marker", "give the markers names of their own")
        names[number] = name
        stated = _reference(marker, default)
        if stated is not None:
            enabled = marker.one("reference").get("enabled", "true") in ENABLED
            role = CONTROL if enabled else CHECK
            roles = [role if np.isfinite(value) else NO_ROLE for value in stated[0]]
            targets.append({"point": name, "xyz_m": stated[0], "sigma_m": stated[1], "role": roles, "at": marker})
    return targets, names


def _give_marks(
    parts: BlockParts, chunk: XmlElement, images: dict[str, str], points: dict[str, str], settings: dict[str, float]
) -> None:
    """The pinned places of markers in the images of the first frame."""
    frames = chunk.all("frames", "frame")
    rows: list[tuple[str, str, list[float], XmlElement]] = []
    own = 0
    for marker in frames[0].all("markers", "marker") if frames else ():
        if marker.get("marker_id") not in points:
            raise marker.error(f"marker {clipped(marker.get('marker_id'))} is not listed", "export the markers again")
        for place in marker.all("location"):
            if place.get("pinned", "true") not in ENABLED:
                own += 1
            elif place.get("camera_id") in images:
                xy = [place.parsed(place.get(axis), axis) for axis in "xy"]
                rows.append((images[place.get("camera_id")], points[marker.get("marker_id")], xy, place))
    if own:
        parts.notes.append(f"left out: {several(own, 'place')} of markers not pinned, projections of Metashape's own")
    if len(frames) > 1:
        parts.notes.append(f"{len(frames)} frames: the markers of the first are read")
    if rows:
        parts.image_points = {
            **{key: [row[k] for row in rows] for k, key in enumerate(("image", "point", "xy"))},
            **({"sigma_px": settings["accuracy_projections"]} if "accuracy_projections" in settings else {}),
            **places([row[3] for row in rows], parts.files),
        }


def _give_ties(parts: BlockParts, ties: TiePoints, sigma_px: float) -> None:
    """The projections of tie points, after the marks."""
    columns = {"image": ties.images, "point": ties.points, "xy": ties.xy_px, "sigma_px": sigma_px}
    of_ties = replace(parts, image_points=columns)
    parts.image_points = together([rows_of(parts, "image_points"), rows_of(of_ties, "image_points")])
    parts.notes.append(f"{len(ties.names)} tie points with {len(ties.images)} projections")


def _recognised(view: FileView) -> str:
    if "doc.xml" in view.names and not view.is_folder:
        return "an archive with doc.xml"
    seen = re.search(r"<document\s+version=.*?<chunk", view.head, re.DOTALL)
    if seen:
        return "XML with <document version> and <chunk>"
    seen = re.search(r"<calibration>\s*<projection>", view.head)
    return "XML with <calibration> and <projection>" if seen else ""


METASHAPE = Format(
    "metashape", "Metashape, PhotoScan", _recognised, "XML with <document version> and <chunk>, or a .psz",
    carries=("cameras", "distortion", "image points", "control", "check points", "positions", "start orientations",
             "standard deviations", "rigs", "frame"),
    page="docs/formats.md#metashape-and-photoscan", read=read_metashape, write=write_metashape,
    written=("cameras", "distortion", "control", "check points", "positions", "start orientations",
             "standard deviations", "frame"),
    estimates_cameras=True,
)  # fmt: skip
