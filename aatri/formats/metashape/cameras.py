"""Images of a document of Metashape, those of groups too.

Of rigs: slave sensors mounted on a master, and the images of one exposure. `rotation` R and `translation` t of a slave
map its axes to those of its master, q_master = R q_slave + t, in units of the chunk. Metashape has adjusted them with
the same observations, so that they are start values here: free.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block_images import RigMembers
from aatri.formats.conventions.poses import Y_UP, rotation_of_carrier
from aatri.formats.metashape.sensors import Sensor
from aatri.formats.text.text_line import once
from aatri.formats.text.xml_tree import XmlElement
from aatri.geometry.rotations import angles_from_rotation


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
    cameras : sequence of ImageElement
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
    n = len(members)
    mounted = np.array([member is not frame for frame, member in members])
    R = np.array([member.rotation for _, member in members]) * Y_UP[:, None] * Y_UP
    table = RigMembers.of(
        rig=[frame.name for frame, _ in members],
        member=[member.name for _, member in members],
        is_frame=~mounted,
        position_m=np.array([member.translation for _, member in members]) * Y_UP * scale * mounted[:, None],
        angles_rad=np.where(mounted[:, None], angles_from_rotation(R), 0.0),
        position_sigma_m=np.where(mounted[:, None], np.nan, np.zeros((n, 3))),
        position_free=np.broadcast_to(mounted[:, None], (n, 3)),
        angle_sigma_rad=np.where(mounted[:, None], np.nan, np.zeros((n, 3))),
        angle_free=np.broadcast_to(mounted[:, None], (n, 3)),
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
