"""XML of MicMac, of its first version (apero) and of MMVII.

First version: `ExportAPERO`, ground points, measured points.

    d = u - CDist,  u' = u + d sum R_i |d|^2i + P1 (|d|^2 + 2 dx^2) + 2 P2 dx dy + b1 dx + b2 dy, ...     px, y down

Rows L1 L2 L3 of `CodageMatr` are R, camera to ground. An orientation file has ten pairs of ground and image points by
which it can be tried; they are tried. Angles in place of the matrix, other projections and other distortions are
refused by name.

Source: MicMac documentation, chapters on the camera models and on ParamApero; reference pairs of the files themselves.

MMVII (`Root`, `MMVII_Serialization`): cameras, poses, ground points, measured points. Texts stand in quotes.

    x' = x + x (K1 r^2 + K2 r^4 + ...) + p1 (r^2 + 2 x^2) + 2 p2 x y + b1 x + b2 y,  y' ...;  px = F (x', y') + PP

Columns AxeI AxeJ AxeK are the axes of the camera in the ground. `Sigma2` of a mark holds xx xy yy in px^2,
`__Opt__Sigma2` of a ground point xx xy xz yy yz zz in m^2.

Source: MMVII documentation, chapter on serialization; the same block in both versions (tests).
"""

from pathlib import PureWindowsPath

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.micmac.project import Mark, MicmacProject, OrientedImage, Target
from aatri.formats.text.xml_tree import XmlElement
from aatri.ids import clipped

CONVENTION = "eConvApero_DistM2C"
"""The one convention of rotation and distortion that is read: a matrix, and a distortion from ground to image."""

MOST_RADIAL = 7

PARTS = {"Radial": "K", "Decentric": "p", "Polynomial": "b"}
"""Parts of a distortion, and how the names of their coefficients begin."""


def add_v1(project: MicmacProject, root: XmlElement) -> bool:
    """Take what a file of the first version gives; False if it gives nothing that is known."""
    before = project.amount()
    for element in root.all("CalibrationInternConique"):
        try:
            project.add_camera(_camera_of_v1(element), element)
        except InputError as error:  # of a camera that no image may be of
            project.without_like[element.path.stem] = error
    for element in root.all("OrientationConique"):
        project.images.append(_image(element))
    for element in root.within("MesureAppuiFlottant1Im"):
        image = element.one("NameIm").text
        for mark in element.all("OneMesureAF1I"):
            none = np.full((2, 2), np.nan)
            project.marks.append(Mark(image, mark.one("NamePt").text, mark.numbers(2, "PtIm"), none, mark))
    for element in root.within("OneAppuisDAF"):
        project.targets.append(_target(element))
    return project.amount() > before


def _target(element: XmlElement) -> Target:
    sigma = element.numbers(3, "Incertitude")
    if not (sigma > 0).all():
        raise element.error(f"Incertitude {sigma.tolist()} is not positive", "give standard deviations in m")
    return Target(element.one("NamePt").text, element.numbers(3, "Pt"), np.diag(sigma**2), element)


def _camera_of_v1(element: XmlElement) -> Lens:
    """A camera; its name is that of its file."""
    _convention(element)
    size, point, f = element.numbers(2, "SzIm"), element.numbers(2, "PP"), element.number("F")
    if f <= 0 or (size <= 0).any():
        raise element.error(f"focal length {f:g}, image of {size[0]:g} x {size[1]:g}", "they are px and positive")
    parameters, centre = _distortion(element, point)
    return Lens(
        element.path.stem,
        "micmac",
        (float(size[0]), float(size[1])),
        (f, f),
        (float(point[0] - size[0] / 2), float(point[1] - size[1] / 2)),
        parameters,
        (float(centre[0] - point[0]), float(centre[1] - point[1])),
        where=element.where,
    )


def _distortion(element: XmlElement, point: Float) -> tuple[dict[str, float], Float]:
    """Parameters by the names of `FORMS["micmac"]`, and the centre of distortion in px."""
    kinds = element.one("CalibDistortion").children
    if len(kinds) != 1 or kinds[0].tag not in ("ModNoDist", "ModRad", "ModPhgrStd"):
        tags = [*(kind.tag for kind in kinds), *(t.text for kind in kinds for t in kind.all("TypeModele"))]
        what = f"the distortion {clipped(' '.join(tags))!r} has no like here"
        raise element.error(what, "known are ModNoDist, ModRad, ModPhgrStd: convert the calibration in MicMac")
    kind = kinds[0]
    if kind.tag == "ModNoDist":
        return {}, point
    radial = kind if kind.tag == "ModRad" else kind.one("RadialePart")
    values = radial.all("CoeffDist")
    if any(value.number() for value in values[MOST_RADIAL:]):
        raise radial.error(f"{len(values)} radial coefficients", f"at most {MOST_RADIAL} are known")
    parameters = {f"R{k}": value.number() for k, value in enumerate(values[:MOST_RADIAL], 1)}
    if kind.tag == "ModPhgrStd":
        parameters |= {name: kind.number(name, default=0.0) for name in ("P1", "P2", "b1", "b2")}
    return parameters, radial.numbers(2, "CDist")


def _image(element: XmlElement) -> OrientedImage:
    """An image; `Orientation-NAME.xml` is the orientation of NAME."""
    affine = element.optional("OrIntImaM2C")
    if affine is not None:
        stated = [affine.numbers(2, name).tolist() for name in ("I00", "V10", "V01")]
        if stated != [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]:
            raise affine.error("an affine transformation of the image (OrIntImaM2C)", "measure in the image itself")
    projection = element.optional("TypeProj")
    if projection is not None and projection.text != "eProjStenope":
        raise projection.error(f"the projection {clipped(projection.text)!r}", "a central projection is wanted")
    outer = element.one("Externe")
    _convention(outer)
    matrix = outer.optional("ParamRotation", "CodageMatr")
    if matrix is None:
        raise outer.error("the rotation is not given as CodageMatr", "export it as a matrix")
    pairs = [np.hstack([p.numbers(2, "Im"), p.numbers(3, "Ter")]) for p in element.all("Verif", "Appuis")]
    return OrientedImage(
        element.path.stem.removeprefix("Orientation-"),
        PureWindowsPath(element.one("FileInterne").text).stem,  # it names a folder of the project, which may be renamed
        outer.numbers(3, "Centre"),
        np.stack([matrix.numbers(3, f"L{k}") for k in (1, 2, 3)]),
        element,
        np.array(pairs).reshape(-1, 5),
        element.number("Verif", "Tol", default=1e-3) if pairs else 0.0,
    )


def _convention(element: XmlElement) -> None:
    stated = element.optional("KnownConv")
    if stated is not None and stated.text != CONVENTION:
        raise stated.error(f"the convention {clipped(stated.text)!r}", f"{CONVENTION} is read: convert it in MicMac")


def add_mmvii(project: MicmacProject, root: XmlElement) -> bool:
    """Take what a file of MMVII gives; False if it gives nothing that is known."""
    kind = _quoted(root.one("Type"))
    if kind != "MMVII_Serialization":
        raise root.error(f"the type is {clipped(kind)!r}", "a file of MMVII_Serialization is wanted")
    data, recognised = root.one("Data"), False
    for element in data.children:
        recognised |= element.tag in ("InternalCalibration", "CameraPose", "SetMesIm", "SetGCP")
        if element.tag == "InternalCalibration":
            project.add_camera(_camera_of_mmvii(element), element)
        elif element.tag == "CameraPose":
            axes = [element.numbers(3, "RotMatrix", name) for name in ("AxeI", "AxeJ", "AxeK")]
            names = (_quoted(element.one("NameImage")), _quoted(element.one("NameInternalCalib")))
            centre = element.numbers(3, "Center")
            project.images.append(OrientedImage(*names, centre, np.stack(axes, axis=1), element, np.zeros((0, 5)), 0.0))
        elif element.tag == "SetMesIm":
            image = _quoted(element.one("NameIm"))
            for mark in element.all("Measures", "el"):
                covariance = _symmetric(mark, "Sigma2", 2)
                project.marks.append(Mark(image, _quoted(mark.one("Name")), mark.numbers(2, "Pt"), covariance, mark))
        elif element.tag == "SetGCP":
            for point in element.all("Measures", "el"):
                covariance = _symmetric(point, "__Opt__Sigma2", 3)
                project.targets.append(Target(_quoted(point.one("Name")), point.numbers(3, "Pt"), covariance, point))
    return recognised


def _quoted(element: XmlElement) -> str:
    text = element.text
    if len(text) < 2 or text[0] != '"' or text[-1] != '"':
        raise element.error(f"{clipped(text)!r} is not in quotes", "export it again")
    return text[1:-1]


def _symmetric(element: XmlElement, name: str, size: int) -> Float:
    """A symmetric matrix of its upper triangle by rows; NaN where it is not stated."""
    if element.optional(name) is None:
        return np.full((size, size), np.nan)
    matrix, rows = np.zeros((size, size)), np.triu_indices(size)
    matrix[rows] = element.numbers(len(rows[0]), name)
    full = np.asarray(matrix + np.triu(matrix, 1).T)
    if np.linalg.eigvalsh(full)[0] <= 0:
        raise element.one(name).error(f"{name} is no covariance matrix", "variances are positive")
    return full


def _camera_of_mmvii(element: XmlElement) -> Lens:
    projection = _quoted(element.one("Projection"))
    if projection != "Stenope":
        raise element.error(f"the projection {clipped(projection)!r} has no like here", "Stenope is read: convert it")
    size, point = element.numbers(2, "PixelFrame", "NbPix"), element.numbers(2, "PerfectProj", "PP")
    f = element.number("PerfectProj", "F")
    if f <= 0 or (size <= 0).any():
        raise element.error(f"focal length {f:g}, image of {size[0]:g} x {size[1]:g}", "they are px and positive")
    parameters = {}
    for part in (child for distortion in element.all("Distorsion") for child in distortion.children):
        for value in part.children:
            if value.number() and not (part.tag in PARTS and value.tag in FORMS["mmvii"].terms):
                raise value.error(f"the distortion {part.tag}/{value.tag} has no like here", "leave it out in MMVII")
            parameters[value.tag] = value.number()
    width, height = size.tolist()
    centre = (float(point[0] - width / 2), float(point[1] - height / 2))
    name = _quoted(element.one("Name"))
    return Lens(name, "mmvii", (width, height), (f, f), centre, parameters, where=element.where)
