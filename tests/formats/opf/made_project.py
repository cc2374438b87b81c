"""A small project of OPF in a map, with two images, control, a check point, a tie point and a track."""

from __future__ import annotations

import json
import struct
from typing import Any

SHIFT = [-500000.0, -4000000.0, -100.0]
FOCAL, CENTRE, SIZE = 2000.5, (2010.5, 1490.25), (4000, 3000)
RADIAL, TANGENTIAL = (0.1, 0.02, 0.003), (0.001, 0.002)
CENTRES = {4611686018427387905: (10.5, 20.25, 30.0), 7: (40.5, 20.25, 30.0)}
"""In the processing system; an id of 64 bits."""
NAMES = {4611686018427387905: "flight 1/a.jpg", 7: "flight 1/b.jpg"}
ANGLES_DEG = (1.0, -2.0, 30.0)


def document(kind: str, **content: Any) -> str:
    return json.dumps({"format": f"application/opf-{kind}+json", "version": "1.0", **content}, indent=1)


def _geolocation(xyz: list[float], sigma: list[float], crs: str = "EPSG:32650") -> dict[str, Any]:
    return {"crs": {"definition": crs}, "coordinates": xyz, "sigmas": sigma}


def _mark(camera: int, x: float, y: float) -> dict[str, Any]:
    return {"camera_id": camera, "position_px": [x, y], "accuracy": 0.5}


def files(*, with_tracks: bool = True) -> dict[str, str]:
    """The text documents of the project."""
    internals = {
        "type": "perspective",
        "principal_point_px": list(CENTRE),
        "focal_length_px": FOCAL,
        "radial_distortion": list(RADIAL),
        "tangential_distortion": list(TANGENTIAL),
    }
    items = {
        "camera_list": ["camera-list"],
        "input_cameras": ["input-cameras"],
        "input_control_points": ["input-control-points"],
        "scene_reference_frame": ["scene-reference-frame"],
        "calibration": ["calibrated-cameras", "gps-bias"],
    }
    captures = [
        {
            "id": k,
            "reference_camera_id": key,
            "cameras": [{"id": key, "sensor_id": 1}],
            "time": "2026-01-01",
            **({"geolocation": _geolocation([500011.0, 4000020.0, 130.0], [0.02, 0.03, 0.05])} if key == 7 else {}),
        }
        for k, key in enumerate(NAMES)
    ]
    resources: list[dict[str, Any]] = [
        {
            "type": item,
            "id": item,
            "sources": [],
            "resources": [{"uri": f"{name}.json", "format": f"application/opf-{name}+json"} for name in names],
        }
        for item, names in items.items()
    ]
    if with_tracks:
        resources[-1]["resources"].append({"uri": "tracks/sparse.gltf", "format": "model/gltf+json"})
    gcp = {"marks": [_mark(7, 100.5, 200.25)]}
    return {
        "project.opf": document("project", name="made", description="", id="1", items=resources),
        "camera-list.json": document("camera-list", cameras=[{"id": k, "uri": name} for k, name in NAMES.items()]),
        "input-cameras.json": document(
            "input-cameras",
            sensors=[{"id": 1, "name": "cam", "image_size_px": list(SIZE), "pixel_size_um": 2.4,
                      "internals": internals | {"focal_length_px": 1900.5}}],
            captures=captures,
        ),
        "input-control-points.json": document(
            "input-control-points",
            gcps=[
                {"id": "G", "geolocation": _geolocation([500012.5, 4000021.0, 110.0], [0.01, 0.01, 0.02]),
                 "is_checkpoint": False, **gcp},
                {"id": "C", "geolocation": _geolocation([36.0, 117.0, 110.0], [0.01, 0.02, 0.03], "EPSG:4979"),
                 "is_checkpoint": True, **gcp},
            ],
            mtps=[{"id": "M", "is_checkpoint": False, **gcp}],
        ),
        "scene-reference-frame.json": document(
            "scene-reference-frame",
            crs={"definition": "EPSG:32650"},
            base_to_canonical={"scale": [1.0, 1.0, 1.0], "shift": SHIFT, "swap_xy": False},
        ),
        "calibrated-cameras.json": document(
            "calibrated-cameras",
            sensors=[{"id": 1, "internals": internals}],
            cameras=[{"id": key, "sensor_id": 1, "position": list(xyz), "orientation_deg": list(ANGLES_DEG)}
                     for key, xyz in CENTRES.items()],
        ),
        "gps-bias.json": document("gps-bias"),
        **({"tracks/sparse.gltf": tracks()} if with_tracks else {}),
    }  # fmt: skip


def tracks() -> str:
    """Two tracks of three matches."""
    views = [{"buffer": k, "byteLength": n} for k, n in enumerate((16, 12, 24))]
    accessors = [
        {"bufferView": 0, "componentType": 5125, "count": 2, "type": "VEC2"},
        {"bufferView": 1, "componentType": 5125, "count": 3, "type": "SCALAR"},
        {"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2"},
    ]
    matches = {"cameraUids": list(NAMES), "pointIndexRanges": 0, "cameraIds": 1, "imagePoints": {"pixelCoordinates": 2}}
    extension = {"extensions": {"OPF_mesh_primitive_matches": matches}}
    buffers = [{"uri": name, "byteLength": 1} for name in BUFFERS]
    document = {
        "asset": {"version": "2.0"},
        "meshes": [{"primitives": [{"attributes": {}, **extension}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": buffers,
    }
    return json.dumps(document, indent=1)


BUFFERS = {
    "ranges.bin": struct.pack("<QQ", 0 | 2 << 40, 2 | 1 << 40),
    "cameras.bin": struct.pack("<3I", 0, 1, 1),
    "pixels.bin": struct.pack("<6f", 1.5, 2.5, 3.5, 4.5, 5.5, 6.5),
}
