"""Sensors of a document of Metashape, and its images, those of groups too.

Of rigs: slave sensors mounted on a master, and the images of one exposure. `rotation` R and `translation` t of a slave
map its axes to those of its master, q_master = R q_slave + t, in units of the chunk. Metashape has adjusted them with
the same observations, so that they are start values here: free.

Sensors are cameras in both dialects of their calibration, and how a slave is mounted on its master:

    up to 1.2     fx fy cx cy skew    cx, cy from the upper left corner
    from 1.4      f cx cy b1 b2       cx, cy from the image centre

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p1 (r^2 + 2 x^2) + 2 p2 x y,  y' likewise with p1 and p2 exchanged
    u = W / 2 + cx + f x' + b1 x' + b2 y',   v = H / 2 + cy + f y'

Source: Agisoft Metashape user manual, appendix on camera models.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block_tables import RigMembers
from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.conventions.pixel_origins import PIXEL_MM
from aatri.formats.conventions.poses import Y_UP, rotation_of_carrier
from aatri.formats.text.text_line import once
from aatri.formats.text.xml_tree import XmlElement
from aatri.geometry.rotations import angles_from_rotation
from aatri.ids import clipped

NO_LIKE = ("p3", "p4")
"""Parameters of the newer dialect that no camera here has."""


class Sensor(NamedTuple):
    """A sensor: its name, its camera (None: it has no calibration), and master and mounting of a slave of a rig.

    `rotation` and `translation` map the camera axes of the slave to those of the master, in units of the chunk.
    """

    name: str
    lens: Lens | None
    master: str
    rotation: Float
    translation: Float


def sensors_of(chunk: XmlElement, used: Collection[str]) -> dict[str, Sensor]:
    """The sensors of a chunk by their ids; those of images alone, `used`, have a camera.

    Raises
    ------
    InputError
        If a calibration has no like, or an id or label stands twice.
    """
    sensors: dict[str, Sensor] = {}
    labels: dict[str, int] = {}
    first: dict[str, XmlElement] = {}
    for element in chunk.all("sensors", "sensor"):
        number = element.get("id")
        once(element, number, first, "sensor")
        label = element.get("label") or f"sensor {number}"
        labels[label] = labels.get(label, 0) + 1
        name = label if labels[label] == 1 else f"{label} {labels[label]}"
        rotation, translation = element.optional("rotation"), element.optional("translation")
        sensors[number] = Sensor(
            name,
            _lens(element, name) if number in used else None,
            element.get("master_id") if element.get("master_id") != number else "",
            np.eye(3) if rotation is None else rotation.numbers(9).reshape(3, 3),
            np.zeros(3) if translation is None else translation.numbers(3),
        )
    return sensors


def _lens(sensor: XmlElement, name: str) -> Lens | None:
    calibrations = sensor.all("calibration")
    adjusted = [c for c in calibrations if c.get("class") == "adjusted"]
    if not calibrations:
        return None
    calibration = (adjusted or calibrations)[0]
    place = calibration.optional("resolution") or sensor.one("resolution")
    width, height = (place.parsed(place.get(side), side) for side in ("width", "height"))
    values = {p.get("name"): p for p in sensor.all("property")}
    pixel = values.get("pixel_width")
    pixel_mm = pixel.parsed(pixel.get("value"), "pixel_width") if pixel is not None else PIXEL_MM
    kind = calibration.get("type") or sensor.get("type", "frame")
    return lens_of(calibration, name, kind, (width, height), pixel_mm)


def lens_of(calibration: XmlElement, name: str, kind: str, size_px: tuple[float, float], pixel_mm: float) -> Lens:
    """The camera of a calibration, in either dialect; `kind` is what Metashape calls its projection.

    Raises
    ------
    InputError
        If it has no like.
    """
    width, height = size_px
    if kind != "frame":
        raise calibration.error(f"a camera of type {clipped(kind)!r} has no like here", "frame cameras are read")
    for name_of in NO_LIKE:
        if calibration.number(name_of, default=0.0):
            raise calibration.one(name_of).error(f"{name_of} has no like here", "calibrate without it")
    parameters = {k: calibration.number(k, default=0.0) for k in FORMS["metashape"].terms}
    cx, cy = (calibration.number(axis, default=0.0) for axis in ("cx", "cy"))
    if calibration.optional("fx") is not None:
        f, fx = calibration.number("fy"), calibration.number("fx")
        parameters |= {"b1": fx - f, "b2": calibration.number("skew", default=0.0)}
        cx, cy = cx - width / 2, cy - height / 2
    else:
        f = calibration.number("f")
    if min(width, height, f, pixel_mm) <= 0:
        raise calibration.error(f"image {width:g} x {height:g}, f = {f:g} px, pixel of {pixel_mm:g} mm", "all positive")
    where = f"{calibration.path}:{calibration.line}"
    return Lens(name, "metashape", (width, height), (f, f), (cx, cy), parameters, pixel_mm=pixel_mm, where=where)


class ImageElement(NamedTuple):
    """An image: its name, and its element."""

    id: str
    name: str
    sensor: str
    master: str
    at: XmlElement


def cameras_of(chunk: XmlElement) -> tuple[list[ImageElement], list[str]]:
    """The images that are enabled, and the names of the others; a label of two images has its group before it."""
    grouped = [in_group for cameras in chunk.all("cameras") for in_group in _in_groups(cameras, "")]
    labels = Counter(element.get("label") for _, element in grouped)
    cameras, disabled, first = [], [], dict[str, XmlElement]()
    for group, element in grouped:
        name, number = element.get("label"), element.get("id")
        if not name or not number:
            raise element.error("a camera without id or label", "export the cameras again")
        name = name if labels[name] == 1 else f"{group}{name}"
        if element.get("enabled", "true") in ("false", "0"):
            disabled.append(name)
            continue
        for key in (f"id {number}", name):
            once(element, key, first, "camera", "give the images names of their own")
        cameras.append(ImageElement(number, name, element.get("sensor_id"), element.get("master_id"), element))
    return cameras, disabled


def _in_groups(element: XmlElement, group: str) -> Iterator[tuple[str, XmlElement]]:
    """Images with the labels of their groups, each with a slash behind it."""
    for child in element.children:
        if child.tag == "camera":
            yield group, child
        elif child.tag == "group":
            yield from _in_groups(child, f"{group}{child.get('label') or child.get('id')}/")


def attitudes_of(cameras: list[ImageElement]) -> dict[str, Float]:
    """Rotations of references with yaw, pitch and roll, to east, north and up."""
    keys, stated = ("roll", "pitch", "yaw"), dict[str, list[float]]()
    for camera in cameras:
        reference = camera.at.optional("reference")
        if reference is not None and all(reference.get(key) for key in keys):
            stated[camera.name] = [reference.parsed(reference.get(key), key) for key in keys]
    R, _ = rotation_of_carrier(np.radians([*stated.values()]).reshape(-1, 3))
    return dict(zip(stated, R))


def rigs_of(
    cameras: Sequence[ImageElement], sensors: Mapping[str, Sensor], scale: float
) -> tuple[dict[str, list[Any]], RigMembers] | None:
    """Columns rig, member and sequence of the images, and the members; None of a chunk without rigs.

    Parameters
    ----------
    sensors : mapping of str to Sensor
        By their ids.
    scale : float
        Metres of a unit of the chunk.
    """
    slaves = {key: s for key, s in sensors.items() if s.master in sensors}
    if not any(c.sensor in slaves for c in cameras):
        return None
    masters = {s.master for s in slaves.values()}
    frames = [(sensors[key], sensors[key]) for key in sensors if key in masters]
    members = sorted(
        [*frames, *((sensors[s.master], s) for s in slaves.values())],
        key=lambda pair: (pair[0].name, pair[1] is not pair[0], pair[1].name),
    )
    mounted = np.array([[member is not frame] * 3 for frame, member in members])
    R = np.array([member.rotation for _, member in members]) * Y_UP[:, None] * Y_UP
    table = RigMembers.of(
        rig=[frame.name for frame, _ in members],
        member=[member.name for _, member in members],
        is_frame=~mounted[:, 0],
        position_m=np.array([member.translation for _, member in members]) * Y_UP * scale * mounted,
        angles_rad=np.where(mounted, angles_from_rotation(R), 0.0),
        position_sigma_m=np.where(mounted, np.nan, 0.0),
        position_free=mounted,
        angle_sigma_rad=np.where(mounted, np.nan, 0.0),
        angle_free=mounted,
    )
    number = {key: k for k, key in enumerate(dict.fromkeys(c.master or c.id for c in cameras), 1)}
    rig = [
        sensors[slaves[c.sensor].master if c.sensor in slaves else c.sensor].name
        if c.sensor in slaves or c.sensor in masters
        else ""
        for c in cameras
    ]
    columns: dict[str, list[Any]] = {
        "rig": rig,
        "member": [sensors[c.sensor].name if name else "" for c, name in zip(cameras, rig)],
        "sequence": [float(number[c.master or c.id]) for c in cameras],
    }
    return columns, table
