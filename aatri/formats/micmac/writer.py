"""Writing of an oriented block for MicMac (first version): orientations, cameras, ground points, measured points.

    Ori-aatri/AutoCal_CAMERA.xml, Ori-aatri/Orientation-IMAGE.xml     with ten pairs each by which they can be tried
    ground_points.xml     DicoAppuisFlottant: control with three coordinates, Incertitude is its standard deviation
    image_points.xml      SetOfMesureAppuisFlottants: every image point, ties too

The forms are those of `dialects`. Exact control has the Incertitude `WRITTEN_SIGMA_M`: zero means nothing there.
"""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from aatri.errors import GeometryError, InputError
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import as_program_states
from aatri.formats.conventions.poses import stated_rotation
from aatri.formats.micmac.dialects import CONVENTION
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.exported_files import WRITTEN_SIGMA_M, full_control
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import element, numbers, write_files, xml_of
from aatri.geometry.collinearity import in_image_axes
from aatri.ids import shown
from aatri.progress import SILENT, Reporter

ORIENTATIONS = "Ori-aatri"
MOST_PAIRS = 10


def write_micmac(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write the folder of orientations, ground points and image points.

    Raises
    ------
    GeometryError
        If no image is oriented.
    InputError
        If a distortion has no like, or names cannot be those of files.
    """
    block, rows = oriented.block, np.flatnonzero(oriented.oriented)
    if not len(rows):
        raise GeometryError("no image has position and rotation", remedy="export a result, or give start values")
    _check_names([*block.images.id.tolist(), *block.cameras.id.tolist()], block.name)
    files = {}
    lenses = {
        k: as_program_states(oriented.lenses[k], ["micmac"], reporter, allowed_px=writing.lens_misfit_px)
        for k in np.unique(block.images.camera[rows]).tolist()
    }
    for lens in lenses.values():
        files[f"{ORIENTATIONS}/AutoCal_{lens.id}.xml"] = xml_of(element("ExportAPERO", _camera(lens)))
    first = np.searchsorted(oriented.rays.image, np.arange(len(block.images) + 1)).tolist()
    for row in rows.tolist():
        lens = lenses[int(block.images.camera[row])]
        pairs = _pairs(oriented, lens, row, slice(first[row], first[row + 1]))
        image = element("ExportAPERO", _image(oriented, row, lens, pairs))
        files[f"{ORIENTATIONS}/Orientation-{block.images.id[row]}.xml"] = xml_of(image)
    control = full_control(oriented, "MicMac", reporter)
    if control:
        targets = [
            element(
                "OneAppuisDAF",
                numbers("Pt", *p.xyz_m.tolist()),
                element("NamePt", p.id),
                numbers("Incertitude", *np.where(p.sigma_m > 0, p.sigma_m, WRITTEN_SIGMA_M).tolist()),
            )
            for p in control
        ]
        files["ground_points.xml"] = xml_of(element("Global", element("DicoAppuisFlottant", *targets)))
        if exact := [p.id for p in control if p.exact]:
            reporter.log(f"exact control gets the Incertitude {WRITTEN_SIGMA_M:g} m: {shown(exact)}")
    if len(oriented.rays.image):
        files["image_points.xml"] = xml_of(element("SetOfMesureAppuisFlottants", *_marks(oriented, first)))
    write_files(folder, files)


def _check_names(names: list[str], block: str) -> None:
    if wrong := [name for name in names if any(sign in name for sign in '/\\:*?"<>|')]:
        what = f"names that cannot be those of files: {shown(wrong)}"
        raise InputError(what, where=f"block {block}", remedy="rename the images")


def _camera(lens: Lens) -> ET.Element:
    (width, height), p = lens.size_px, lens.parameters
    point = (width / 2 + lens.principal_point_px[0], height / 2 + lens.principal_point_px[1])
    centre = (point[0] + lens.centre_px[0], point[1] + lens.centre_px[1])
    radial = [element("CoeffDist", p.get(f"R{k}", 0.0)) for k in range(1, 8)]
    model = element(
        "ModPhgrStd",
        element("RadialePart", numbers("CDist", *centre), *radial),
        *(element(name, p.get(name, 0.0)) for name in ("P1", "P2", "b1", "b2")),
    )
    return element(
        "CalibrationInternConique",
        element("KnownConv", CONVENTION),
        numbers("PP", *point),
        element("F", lens.focal_px[0]),
        numbers("SzIm", int(width), int(height)),
        element("CalibDistortion", model),
    )


def _image(oriented: OrientedBlock, row: int, lens: Lens, pairs: list[ET.Element]) -> ET.Element:
    R = stated_rotation(oriented.ground_from_image[row], "micmac").tolist()
    matrix = element("CodageMatr", *(numbers(f"L{k}", *line) for k, line in enumerate(R, 1)))
    affine = {"I00": (0, 0), "V10": (1, 0), "V01": (0, 1)}
    return element(
        "OrientationConique",
        element("OrIntImaM2C", *(numbers(name, *pair) for name, pair in affine.items())),
        element("TypeProj", "eProjStenope"),
        element("FileInterne", f"{ORIENTATIONS}/AutoCal_{lens.id}.xml"),
        element("RelativeNameFI", "true"),
        element(
            "Externe",
            element("KnownConv", CONVENTION),
            numbers("Centre", *oriented.position_m[row].tolist()),
            element("ParamRotation", matrix),
        ),
        element("ConvOri", element("KnownConv", CONVENTION)),
        *([element("Verif", element("Tol", 1e-3), element("ShowMes", "true"), *pairs)] if pairs else []),
    )


def _pairs(oriented: OrientedBlock, lens: Lens, row: int, of_image: slice) -> list[ET.Element]:
    """Points of the image with the place where its camera sees them."""
    points = oriented.rays.point[of_image]
    points = points[np.isfinite(oriented.xyz_m[points]).all(axis=1)][:MOST_PAIRS]
    xyz = oriented.xyz_m[points]
    image_row = np.full(len(xyz), row)
    u = in_image_axes(oriented.position_m[image_row], oriented.ground_from_image[image_row], xyz)
    xy_px = lens.projected(u[:, :2] * [-1.0, 1.0] / u[:, 2:]) + np.array(lens.size_px) / 2
    return [
        element("Appuis", element("Num", k), numbers("Im", *xy), numbers("Ter", *ground))
        for k, (xy, ground) in enumerate(zip(xy_px.tolist(), xyz.tolist()))
    ]


def _marks(oriented: OrientedBlock, first: list[int]) -> list[ET.Element]:
    block, rays, xy = oriented.block, oriented.rays, oriented.from_corner_px(oriented.rays).tolist()
    names = block.points.id[rays.point].tolist()
    marks = [
        element("OneMesureAF1I", element("NamePt", name), numbers("PtIm", *place)) for name, place in zip(names, xy)
    ]
    return [
        element("MesureAppuiFlottant1Im", element("NameIm", image), *marks[a:b])
        for image, a, b in zip(block.images.id.tolist(), first, first[1:])
        if b > a
    ]
