"""Sensors of Metashape: cameras in both dialects of their calibration, and how a slave is mounted on its master.

    up to 1.2     fx fy cx cy skew    cx, cy from the upper left corner
    from 1.4      f cx cy b1 b2       cx, cy from the image centre

    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + p1 (r^2 + 2 x^2) + 2 p2 x y,  y' likewise with p1 and p2 exchanged
    u = W / 2 + cx + f x' + b1 x' + b2 y',   v = H / 2 + cy + f y'

Source: Agisoft Metashape user manual, appendix on camera models.
"""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.conventions.pixel_origins import PIXEL_MM
from aatri.formats.text.text_line import once
from aatri.formats.text.xml_tree import XmlElement
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
