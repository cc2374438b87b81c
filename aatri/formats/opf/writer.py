"""Writing of an oriented block as an OPF project: a JSON document an item, beside `project.opf`.

Cameras are perspective sensors with R1 R2 R3 T1 T2; control and check points are GCPs, all other points manual tie
points, so that image points keep their digits, names and standard deviations; adjusted points are calibrated control
points. The processing system is the map of the block, less a shift; a block in no map gets an engineering system.

Source: the specification, github.com/Pix4D/opf-spec, version 1.0.
"""

import json
import uuid
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.codes import OBSERVED_VALUE
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import as_program_states
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.parts.of_block import frame_of
from aatri.formats.results.exported_files import ControlPoint, control_points
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import write_files
from aatri.frames.conversion import Frame, crs_of
from aatri.frames.heights import is_tangent_frame
from aatri.geometry.rotations import angles_from_rotation
from aatri.ids import shown
from aatri.progress import SILENT, Reporter

ENGINEERING = (
    'ENGCRS["Local",EDATUM["Local"],CS[Cartesian,3],AXIS["easting (X)",east,ORDER[1]],AXIS["northing (Y)",north,'
    'ORDER[2]],AXIS["up (Z)",up,ORDER[3]],LENGTHUNIT["metre",1.0]]'
)
ITEMS = {
    "camera_list": ("camera-list",),
    "input_cameras": ("input-cameras",),
    "input_control_points": ("input-control-points",),
    "scene_reference_frame": ("scene-reference-frame",),
    "calibration": ("calibrated-cameras", "calibrated-control-points"),
}
"""Items of the project, and the documents of each."""
SOURCES = {
    "input_cameras": ("camera_list",),
    "input_control_points": ("camera_list",),
    "calibration": ("input_cameras", "scene_reference_frame", "input_control_points"),
}
NO_TIME = "1970-01-01T00:00:00Z"


class _Scene(NamedTuple):
    """Definition of the coordinate system, whether it has north first, and canonical less base coordinates, m."""

    definition: str
    north_first: bool
    shift_m: Float

    def stated(self, xyz_m: Float) -> list[float]:
        """Coordinates in the order of the system's axes."""
        x, y, z = xyz_m.tolist()
        return [y, x, z] if self.north_first else [x, y, z]


def write_opf(oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT) -> None:
    """Write `project.opf` and its documents."""
    block = oriented.block
    lenses = [as_program_states(lens, ["opf"], reporter, allowed_px=writing.lens_misfit_px) for lens in oriented.lenses]
    scene = _scene(oriented, reporter)
    control = [p for p in control_points(oriented) if all(p.known)]
    if partial := [p.id for p in control_points(oriented) if not all(p.known)]:
        reporter.warn(f"plan-only and height-only points are written as tie points: {shown(partial)}")
    crs = {"definition": scene.definition}
    shift = {"scale": [1.0, 1.0, 1.0], "swap_xy": scene.north_first, "shift": scene.shift_m.tolist()}
    cameras = [{"id": k, "uri": name} for k, name in enumerate(block.images.id.tolist(), 1)]
    placed = np.flatnonzero(np.isfinite(oriented.xyz_m).all(axis=1)).tolist()
    points = [
        {"id": str(block.points.id[k]), "coordinates": (oriented.xyz_m[k] + scene.shift_m).tolist()} for k in placed
    ]
    documents: dict[str, dict[str, Any]] = {
        "camera-list": {"cameras": cameras},
        "input-cameras": {
            "sensors": [_sensor(k, lens) for k, lens in enumerate(lenses, 1)],
            "captures": _captures(oriented, scene),
        },
        "input-control-points": _marked(oriented, control, scene),
        "scene-reference-frame": {"crs": crs, "base_to_canonical": shift},
        "calibrated-cameras": _calibrated(oriented, lenses, scene),
        "calibrated-control-points": {"points": points},
    }
    files = {f"{name}.json": _document(name, content) for name, content in documents.items()}
    write_files(folder, {"project.opf": _project(block.name), **files})


def _document(name: str, content: dict[str, Any]) -> str:
    head = {"format": f"application/opf-{name}+json", "version": "1.0"}
    return json.dumps(head | content, indent=1, ensure_ascii=False) + "\n"


def _project(name: str) -> str:
    ids = {item: str(uuid.uuid5(uuid.NAMESPACE_URL, f"aatri/{name}/{item}")) for item in ("project", *ITEMS)}
    items = [
        {
            "id": ids[item],
            "type": item,
            "resources": [{"uri": f"{r}.json", "format": f"application/opf-{r}+json"} for r in resources],
            "sources": [{"id": ids[source], "type": source} for source in SOURCES.get(item, ())],
        }
        for item, resources in ITEMS.items()
    ]
    return _document("project", {"id": ids["project"], "name": name, "description": "written by aatri", "items": items})


def _scene(oriented: OrientedBlock, reporter: Reporter) -> _Scene:
    frame = frame_of(oriented.block)
    centres_m = oriented.position_m[np.isfinite(oriented.position_m).all(axis=1)]
    shift_m = -np.round(centres_m.mean(axis=0)) if len(centres_m) else np.zeros(3)
    if frame.crs == "local" or is_tangent_frame(frame.crs) or "x" in frame.axes:
        if frame.crs != "local":
            reporter.log(f"{frame.crs} is no map: the scene is written as an engineering system")
        return _Scene(ENGINEERING, False, np.zeros(3))
    system = crs_of(frame)
    flat = crs_of(Frame(frame.name, frame.axes, frame.crs)).to_2d()
    by_code = all(text.startswith("EPSG:") for text in (frame.crs, frame.vertical or "EPSG:"))
    codes = frame.crs + (f"+{frame.vertical.removeprefix('EPSG:')}" if frame.vertical else "")
    return _Scene(codes if by_code else system.to_wkt(), flat.axis_info[0].direction == "north", shift_m)


def _internals(lens: Lens) -> dict[str, Any]:
    x, y = (side / 2 + offset for side, offset in zip(lens.size_px, lens.principal_point_px))
    p = lens.parameters
    return {
        "type": "perspective",
        "principal_point_px": [x, y],
        "focal_length_px": lens.focal_px[0],
        "radial_distortion": [p["R1"], p["R2"], p["R3"]],
        "tangential_distortion": [p["T1"], p["T2"]],
    }


def _sensor(number: int, lens: Lens) -> dict[str, Any]:
    return {
        "id": number,
        "name": lens.id,
        "bands": [{"name": "Gray", "weight": 1.0}],
        "image_size_px": [round(size) for size in lens.size_px],
        "pixel_size_um": lens.pixel_mm * 1e3,
        "internals": _internals(lens),
        "shutter_type": "global",
    }


def _captures(oriented: OrientedBlock, scene: _Scene) -> list[dict[str, Any]]:
    """A capture an image, with its observed position."""
    block, e = oriented.block, oriented.block.exterior
    observed = dict(
        zip(e.image[e.position_use == OBSERVED_VALUE].tolist(), np.flatnonzero(e.position_use == OBSERVED_VALUE))
    )
    captures = []
    for row, sensor in enumerate((block.images.camera + 1).tolist()):
        camera = {
            "id": row + 1,
            "sensor_id": sensor,
            "model_source": "user",
            "pixel_type": "uint8",
            "pixel_range": {"min": 0, "max": 255},
        }
        capture: dict[str, Any] = {
            "id": row + 1,
            "reference_camera_id": row + 1,
            "cameras": [camera],
            "rig_model_source": "not_applicable",
            "time": NO_TIME,
        }
        if row in observed:
            k = observed[row]
            sigma = np.sqrt(np.diag(e.position_covariance_m2[k]))
            capture["geolocation"] = _geolocation(scene, e.position_m[k], sigma)
        captures.append(capture)
    return captures


def _geolocation(scene: _Scene, xyz_m: Float, sigma_m: Float) -> dict[str, Any]:
    crs = {"definition": scene.definition}
    return {"crs": crs, "coordinates": scene.stated(xyz_m), "sigmas": scene.stated(sigma_m)}


def _calibrated(oriented: OrientedBlock, lenses: list[Lens], scene: _Scene) -> dict[str, Any]:
    rows = np.flatnonzero(oriented.oriented).tolist()
    degrees = np.degrees(angles_from_rotation(oriented.ground_from_image))
    cameras = [
        {
            "id": row + 1,
            "sensor_id": int(oriented.block.images.camera[row]) + 1,
            "position": (oriented.position_m[row] + scene.shift_m).tolist(),
            "orientation_deg": degrees[row].tolist(),
        }
        for row in rows
    ]
    return {
        "sensors": [{"id": k, "internals": _internals(lens)} for k, lens in enumerate(lenses, 1)],
        "cameras": cameras,
    }


def _marked(oriented: OrientedBlock, control: list[ControlPoint], scene: _Scene) -> dict[str, Any]:
    """Control and check points, and all others as tie points, with their marks."""
    block, rays = oriented.block, oriented.rays
    accuracy = np.sqrt((rays.sigma_px**2).mean(axis=1)).tolist()
    marks = [
        {"camera_id": image + 1, "position_px": xy, "accuracy": sigma}
        for image, xy, sigma in zip(rays.image.tolist(), oriented.from_corner_px(rays).tolist(), accuracy)
    ]
    of_points = {point: [marks[k] for k in rows] for point, rows in rays.of_points().items()}
    bound = {p.row for p in control}
    gcps = [
        {
            "id": p.id,
            "geolocation": _geolocation(scene, p.xyz_m, p.sigma_m),
            "marks": of_points.get(p.row, []),
            "is_checkpoint": p.is_check,
        }
        for p in control
    ]
    mtps = [
        {"id": str(block.points.id[row]), "marks": of_point, "is_checkpoint": False}
        for row, of_point in of_points.items()
        if row not in bound
    ]
    return {"gcps": gcps, "mtps": mtps}
