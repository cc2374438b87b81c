"""XML of MMVII (`Root`, `MMVII_Serialization`): cameras, poses, ground points, measured points. Texts stand in quotes.

    x' = x + x (K1 r^2 + K2 r^4 + ...) + p1 (r^2 + 2 x^2) + 2 p2 x y + b1 x + b2 y,  y' ...;  px = F (x', y') + PP

Columns AxeI AxeJ AxeK are the axes of the camera in the ground. `Sigma2` of a mark holds xx xy yy in px^2,
`__Opt__Sigma2` of a ground point xx xy xz yy yz zz in m^2.

Source: MMVII documentation, chapter on serialization; the same block in both versions (tests).
"""

import numpy as np

from aatri.arrays import Float
from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.micmac.project import Mark, MicmacProject, OrientedImage, Target
from aatri.formats.text.xml_tree import XmlElement
from aatri.ids import clipped

PARTS = {"Radial": "K", "Decentric": "p", "Polynomial": "b"}
"""Parts of a distortion, and how the names of their coefficients begin."""


def add_mmvii(project: MicmacProject, root: XmlElement) -> bool:
    """Take what a file of MMVII gives; False if it gives nothing that is known."""
    kind = _quoted(root.one("Type"))
    if kind != "MMVII_Serialization":
        raise root.error(f"the type is {clipped(kind)!r}", "a file of MMVII_Serialization is wanted")
    data, known = root.one("Data"), False
    for element in data.children:
        known |= element.tag in ("InternalCalibration", "CameraPose", "SetMesIm", "SetGCP")
        if element.tag == "InternalCalibration":
            project.add_camera(_camera(element), element)
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
    return known


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


def _camera(element: XmlElement) -> Lens:
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
