"""Writing of an oriented block as Metashape's cameras.xml and markers.xml, version 2.0, as `reader` reads them.

A block of a map is moved into geocentric coordinates on its datum, as Metashape has them; what this does to the image
points is told. Control and check points are markers with their references, enabled or not, and pinned places; other
points and their image points have no place in these files. Observed positions are references of the cameras.
"""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from aatri.codes import OBSERVED_VALUE
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import as_program_states
from aatri.formats.conventions.poses import stated_rotation
from aatri.formats.metashape.chunk_frame import geocentric_frame
from aatri.formats.parts.block_parts import LOCAL
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.parts.of_block import frame_of
from aatri.formats.results.exported_files import WRITTEN_SIGMA_M, ControlPoint, control_points
from aatri.formats.results.horizon import MovedBlock, as_it_is, in_other_frame
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import element, numbers, write_files, xml_of
from aatri.frames.conversion import crs_of
from aatri.ids import shown
from aatri.progress import SILENT, Reporter

VERSION = "2.0.0"
LOCAL_SYSTEM = 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1,AUTHORITY["EPSG","9001"]]]'


def write_metashape(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write `cameras.xml` and, with control or check points, `markers.xml`."""
    block, frame = oriented.block, frame_of(oriented.block)
    lenses = [
        as_program_states(lens, ["metashape"], reporter, allowed_px=writing.lens_misfit_px) for lens in oriented.lenses
    ]
    if frame == LOCAL:
        system, moved = LOCAL_SYSTEM, as_it_is(oriented)
    else:
        declared = crs_of(frame)
        system = (declared if frame.vertical else declared.to_2d()).to_wkt("WKT1_GDAL")
        moved = in_other_frame(oriented, geocentric_frame(declared), reporter)
    centres_m = moved.position_m[oriented.oriented]
    origin = np.zeros(3) if frame == LOCAL or not len(centres_m) else np.round(centres_m.mean(axis=0))
    control = [p for p in control_points(oriented) if all(p.known)]
    reference = element("reference", system)
    cameras = [_camera(oriented, moved, row, origin) for row in range(len(block.images))]
    transform = element(
        "transform",
        numbers("rotation", *np.eye(3).ravel().tolist()),
        numbers("translation", *origin.tolist()),
        element("scale", 1.0),
    )
    sensors = [_sensor(k, lens) for k, lens in enumerate(lenses)]
    files = {"cameras.xml": _document(element("sensors", *sensors), element("cameras", *cameras), transform, reference)}
    if control:
        names = [element("camera", id=row, label=str(name)) for row, name in enumerate(block.images.id.tolist())]
        markers = [_marker(k, p) for k, p in enumerate(control)]
        frames = element("frames", element("frame", _places(oriented, control), id=0))
        files["markers.xml"] = _document(element("cameras", *names), element("markers", *markers), frames, reference)
        if exact := [p.id for p in control if p.exact]:
            reporter.log(f"exact control gets the accuracy {WRITTEN_SIGMA_M:g} m: {shown(exact)}")
    if partial := [p.id for p in control_points(oriented) if not all(p.known)]:
        reporter.warn(f"plan-only and height-only points have no place in markers, and are left out: {shown(partial)}")
    write_files(folder, files)
    reporter.log("image points of control and check points are written as pinned marks; tie points have no place")


def _document(*content: ET.Element) -> str:
    return xml_of(element("document", element("chunk", *content, label="aatri", enabled="true"), version=VERSION))


def _sensor(number: int, lens: Lens) -> ET.Element:
    width, height = (int(side) for side in lens.size_px)
    values = {"f": lens.focal_px[0], "cx": lens.principal_point_px[0], "cy": lens.principal_point_px[1]}
    properties = {
        "pixel_width": lens.pixel_mm,
        "pixel_height": lens.pixel_mm,
        "focal_length": lens.focal_px[0] * lens.pixel_mm,
    }
    size = {"width": width, "height": height}
    return element(
        "sensor",
        element("resolution", **size),
        *(element("property", name=name, value=value) for name, value in properties.items()),
        element(
            "calibration",
            element("resolution", **size),
            *(element(name, value) for name, value in {**values, **lens.parameters}.items()),
            **{"type": "frame", "class": "adjusted"},
        ),
        id=number,
        label=lens.id,
        type="frame",
    )


def _camera(oriented: OrientedBlock, moved: MovedBlock, row: int, origin: np.ndarray) -> ET.Element:
    block = oriented.block
    camera = element("camera", id=row, sensor_id=int(block.images.camera[row]), label=str(block.images.id[row]))
    if oriented.oriented[row]:
        transform = np.eye(4)
        transform[:3, :3] = stated_rotation(moved.ground_from_image[row], "metashape")
        transform[:3, 3] = moved.position_m[row] - origin
        camera.append(numbers("transform", *transform.ravel().tolist()))
    at = np.flatnonzero((block.exterior.image == row) & (block.exterior.position_use == OBSERVED_VALUE))
    if len(at):
        sigma = np.sqrt(np.diag(block.exterior.position_covariance_m2[at[0]]))
        camera.append(_reference(block.exterior.position_m[at[0]].tolist(), sigma.tolist(), enabled=True))
    return camera


def _reference(xyz: list[float], sigma: list[float], *, enabled: bool) -> ET.Element:
    x, y, z = xyz
    sx, sy, sz = (s if s > 0 else WRITTEN_SIGMA_M for s in sigma)
    return element("reference", x=x, y=y, z=z, sx=sx, sy=sy, sz=sz, enabled="true" if enabled else "false")


def _marker(number: int, p: ControlPoint) -> ET.Element:
    reference = _reference(p.xyz_m.tolist(), p.sigma_m.tolist(), enabled=not p.is_check)
    return element("marker", reference, id=number, label=p.id)


def _places(oriented: OrientedBlock, control: list[ControlPoint]) -> ET.Element:
    rays, rows = oriented.rays, oriented.rays.of_points()
    xy = oriented.from_corner_px(rays).tolist()
    markers = [
        element(
            "marker",
            *(
                element("location", camera_id=int(rays.image[k]), pinned="true", x=xy[k][0], y=xy[k][1])
                for k in rows.get(p.row, [])
            ),
            marker_id=number,
        )
        for number, p in enumerate(control)
    ]
    return element("markers", *markers)
