"""Images of a document of Metashape, those of groups too."""

from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.formats.conventions.poses import rotation_of_carrier
from aatri.formats.text.text_line import once
from aatri.formats.text.xml_tree import XmlElement


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
