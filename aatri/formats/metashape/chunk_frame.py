"""The world of a chunk of Metashape: its transform, and the coordinate system of its reference.

A chunk with a geographic or projected reference is transformed into geocentric coordinates on its datum; one with a
local reference into that. Poses, positions and markers are given out in one frame: the map of the reference, with its
heights, or the UTM zone where it is in degrees.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.codes import APPROXIMATE, APPROXIMATE_VALUE, OBSERVED_VALUE
from aatri.formats.conventions.poses import is_rotation
from aatri.formats.metashape.tie_points import TiePoints
from aatri.formats.parts.block_parts import LOCAL, PLANE, BlockParts, rows_of, together
from aatri.formats.parts.one_frame import geographic, in_frame
from aatri.formats.text.text_line import places
from aatri.formats.text.xml_tree import XmlElement
from aatri.frames.conversion import Frame
from aatri.frames.crs_text import crs_from
from aatri.frames.own_map import utm_of
from aatri.ids import clipped
from aatri.progress import Reporter

CARTESIAN = {
    "subtype": "Cartesian",
    "axis": [
        {"name": f"Geocentric {axis}", "abbreviation": axis, "direction": f"geocentric{axis}", "unit": "metre"}
        for axis in "XYZ"
    ],
}

ENGINEERING = ("LOCAL_CS", "ENGCRS", "ENGINEERINGCRS")
"""What the WKT of a local system begins with, in capitals or not (ISO 19162)."""


def geocentric_frame(system: Any) -> Frame:
    """Geocentric coordinates on the datum of a coordinate reference system of pyproj."""
    import pyproj

    body = system.geodetic_crs.to_json_dict()
    kept = {key: body[key] for key in ("datum", "datum_ensemble") if key in body}
    made = {"type": "GeodeticCRS", "name": f"{body['name']} geocentric", **kept, "coordinate_system": CARTESIAN}
    return Frame("geocentric", ("x", "y", "z"), pyproj.CRS.from_json_dict(made).to_wkt())


@dataclass
class ChunkFrame:
    """Transforms of the chunk and its components, and the frames of its poses (`world`) and of its reference."""

    transforms: dict[str, tuple[Float, float, Float]]
    world: Frame
    reference: Frame

    def transform(self, component: str) -> tuple[Float, float, Float]:
        """Rotation, scale and origin of a component; of the chunk where it has none of its own."""
        return self.transforms.get(component, self.transforms.get("", (np.eye(3), 1.0, np.zeros(3))))

    def give(
        self,
        parts: BlockParts,
        poses: tuple[Sequence[Any], Float, Float],
        references: tuple[Sequence[tuple[Any, list[float], list[float]]], Mapping[str, Float]],
        targets: Sequence[Mapping[str, Any]],
        ties: TiePoints | None,
        reporter: Reporter,
    ) -> None:
        """Put poses, positions, targets and tie points into the parts, all in one frame."""
        aligned, position, rotation = poses
        start = BlockParts("metashape", parts.files, frame=self.world)
        stated = BlockParts("metashape", parts.files, frame=self.reference)
        if aligned:
            start.exterior = {"image": [c.name for c in aligned], "position_m": position, "ground_from_image": rotation}
        observed, attitudes = references
        if observed:
            names, xyz, sigma = zip(*((camera.name, xyz, sigma) for camera, xyz, sigma in observed))
            stated.exterior = {"image": list(names), "position_m": np.array(xyz), "sigma_m": np.array(sigma)}
            if attitudes:
                turned = np.array([attitudes.get(name, np.full((3, 3), np.nan)) for name in names])
                stated.exterior = {**stated.exterior, "ground_from_image": turned}
        if targets:
            at = places([t["at"] for t in targets], parts.files)
            stated.ground_points = {k: [t[k] for t in targets] for k in ("point", "xyz_m", "sigma_m", "role")} | at
        if ties is not None:
            R, scale, origin = self.transform(next(iter(self.transforms), ""))
            placed = scale * ties.xyz @ R.T + origin
            start.ground_points = {"point": ties.names, "xyz_m": placed, "sigma_m": 0.0, "role": APPROXIMATE}
        parts.frame = self._common(start, stated)
        if parts.frame is not None and self.reference != LOCAL:
            start, stated = in_frame(start, parts.frame, reporter), in_frame(stated, parts.frame, reporter)
        parts.ground_points = stated.ground_points
        if ties is not None:
            parts.ground_points = together([rows_of(of, "ground_points") for of in (stated, start)])
        parts.exterior = _together(start.exterior, stated.exterior)

    def _common(self, start: BlockParts, stated: BlockParts) -> Frame | None:
        if not self.reference.geographic:
            plane = self.reference == LOCAL and (stated.ground_points or stated.exterior)
            return PLANE if plane else self.reference
        coordinates = [stated.exterior.get("position_m"), stated.ground_points.get("xyz_m")]
        degrees = [np.asarray(xyz, dtype=float).reshape(-1, 3) for xyz in coordinates if xyz is not None]
        if start.exterior and self.world != LOCAL:
            degrees.append(geographic(np.asarray(start.exterior["position_m"]), self.world))
        if not degrees:
            return None
        longitude, latitude, _ = np.median(np.concatenate(degrees), axis=0).tolist()
        return utm_of(self.reference, latitude, longitude)


def frame_of_chunk(chunk: XmlElement) -> ChunkFrame:
    """The transforms of a chunk and the system of its reference.

    Raises
    ------
    InputError
        If the system is not understood, or a transform is none.
    """
    transforms = {}
    for key, element in [("", chunk), *((c.get("id"), c) for c in chunk.all("components", "component"))]:
        transform = element.optional("transform")
        if transform is not None and (transform.text or transform.optional("rotation") is not None):
            transforms[key] = _similarity(transform)
    stated = chunk.optional("reference")
    text = stated.text if stated is not None else ""
    if stated is None or not text or text.upper().startswith(ENGINEERING):
        frame = PLANE if text and transforms else LOCAL  # a chunk that is not transformed is a free model
        return ChunkFrame(transforms, frame, frame)
    try:
        system = crs_from(text)
        vertical = system.sub_crs_list[1].to_wkt() if system.is_compound else ""
        flat = system.sub_crs_list[0] if system.is_compound else system
    except Exception as error:  # of pyproj
        raise stated.error(
            f"the coordinate system {clipped(text)!r} is not understood", "export in a known one"
        ) from error
    if flat.geodetic_crs is None:
        what = f"the coordinate system {clipped(text)!r} has no horizontal part"
        raise stated.error(what, "export in a geographic, projected or geocentric one, or a local one")
    axes = ("x", "y", "z") if flat.is_geocentric else ("east", "north", "up")
    if flat.is_geographic:
        axes = ("longitude", "latitude", "height")
    code = flat.to_authority(min_confidence=100)
    reference = Frame("metashape", axes, ":".join(code) if code else flat.to_wkt(), vertical)
    return ChunkFrame(transforms, geocentric_frame(flat) if transforms else LOCAL, reference)


def _similarity(transform: XmlElement) -> tuple[Float, float, Float]:
    """Rotation, scale and origin: as three elements, or as a matrix [s R, T; 0 1] by rows (PhotoScan before 1.1)."""
    if transform.children:
        R, scale = transform.numbers(9, "rotation").reshape(3, 3), transform.number("scale", default=1.0)
        origin = transform.numbers(3, "translation")
    else:
        matrix = transform.numbers(16).reshape(4, 4)
        scale = float(np.cbrt(np.linalg.det(matrix[:3, :3])))
        R, origin = matrix[:3, :3] / scale if scale > 0 else matrix[:3, :3], matrix[:3, 3]
    if not is_rotation(R) or scale <= 0:
        raise transform.error(f"its rotation is none, or the scale {scale:g} is not positive", "export again")
    return R, scale, origin


def _together(start: Mapping[str, Any], observed: Mapping[str, Any]) -> dict[str, Any]:
    """A row an image: the rotation of its pose, else of its reference, and its observed position, else of the pose."""
    images = list(dict.fromkeys([*start.get("image", ()), *observed.get("image", ())]))
    if not images:
        return {}
    row = {name: k for k, name in enumerate(images)}
    position, rotation = np.full((len(images), 3), np.nan), np.full((len(images), 3, 3), np.nan)
    covariance, use = np.full((len(images), 3, 3), np.nan), np.full(len(images), APPROXIMATE_VALUE)
    if start:
        at = [row[name] for name in start["image"]]
        position[at], rotation[at] = start["position_m"], start["ground_from_image"]
    if observed:
        at = [row[name] for name in observed["image"]]
        sigma = observed.get("sigma_m")
        position[at], use[at] = observed["position_m"], OBSERVED_VALUE
        of_reference = observed.get("ground_from_image", np.full((len(at), 3, 3), np.nan))
        rotation[at] = np.where(np.isfinite(rotation[at]), rotation[at], of_reference)
        covariance[at] = observed.get("position_covariance_m2", np.nan)
        if sigma is not None:
            covariance[at] = np.where(np.eye(3, dtype=bool), np.asarray(sigma)[:, :, None] ** 2, 0.0)
    made = {"image": images, "position_m": position, "position_covariance_m2": covariance, "position_use": use}
    return made | ({"ground_from_image": rotation} if np.isfinite(rotation).any() else {})
