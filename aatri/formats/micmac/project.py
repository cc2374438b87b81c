"""What XML files of MicMac give, of either version, collected file by file and checked as a whole.

Both versions have R = the axes of the camera in the ground (x right, y down, z forward), as rows of a matrix in the
first and as its columns in MMVII, and the projection centre. Image coordinates are px, y down; the origin of both, and
of the principal point, is the upper left corner.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.errors import Faults, InputError, raise_all
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.poses import is_rotation
from aatri.formats.text.text_line import once
from aatri.formats.text.xml_tree import XmlElement
from aatri.ids import did_you_mean


class OrientedImage(NamedTuple):
    """An image: name, camera, centre in m, the axes of its camera as columns in the ground.

    The check `pairs` of the file are (m, 5): column and row in px, X Y Z in m; `tolerance_px` is what it grants them.
    """

    name: str
    camera: str
    centre_m: Float
    axes: Float
    at: XmlElement
    pairs: Float
    tolerance_px: float


class Mark(NamedTuple):
    """A point measured in an image, px, with its covariance in px^2 where the file states one."""

    image: str
    point: str
    xy_px: Float
    covariance_px2: Float
    at: XmlElement


class Target(NamedTuple):
    """A ground point, m, with its covariance in m^2."""

    point: str
    xyz_m: Float
    covariance_m2: Float
    at: XmlElement


@dataclass
class MicmacProject:
    """What was read; `camera_at` has the place of each camera, `without_like` what is wrong with those not taken."""

    files: list[Path] = field(default_factory=list)
    cameras: dict[str, Lens] = field(default_factory=dict)
    camera_at: dict[str, XmlElement] = field(default_factory=dict)
    without_like: dict[str, InputError] = field(default_factory=dict)
    images: list[OrientedImage] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    targets: list[Target] = field(default_factory=list)

    def amount(self) -> int:
        """How much was read: cameras, images, marks, ground points."""
        cameras = len(self.cameras) + len(self.without_like)
        return cameras + len(self.images) + len(self.marks) + len(self.targets)

    def add_camera(self, lens: Lens, at: XmlElement) -> None:
        """A camera, each name once."""
        once(at, lens.id, self.camera_at, "camera")
        self.cameras[lens.id] = lens

    def check(self) -> None:
        """Faults of the files together: names, references, rotations, the check pairs that the files bring along."""
        problems = Faults()
        for what, names in (
            ("image", [(image.name, image.at) for image in self.images]),
            ("point", [(f"{m.point} in image {m.image}", m.at) for m in self.marks]),
            ("ground point", [(target.point, target.at) for target in self.targets]),
        ):
            first: dict[str, XmlElement] = {}
            for name, at in names:
                with problems.kept():
                    once(at, name, first, what)
        used = {image.camera for image in self.images}
        problems += [error for name, error in self.without_like.items() if name in used or not used]
        for image in self.images:
            if image.camera in self.without_like:
                continue
            if image.camera not in self.cameras:
                near = did_you_mean(image.camera, self.cameras)
                what = f"its camera {image.camera} is in none of the files{near}"
                problems.append(image.at.error(what, "put the calibration beside the orientations"))
            elif not is_rotation(image.axes):
                problems.append(image.at.error(f"image {image.name}: its matrix is no rotation", "export it again"))
            elif (worst := self._worst_pair_px(image)) > image.tolerance_px:
                what = f"image {image.name}: the check points of the file fall up to {worst:.3g} px from their place"
                remedy = "orientation and camera do not belong together, or were changed by hand"
                problems.append(image.at.error(f"{what}, more than {image.tolerance_px:g}", remedy))
        raise_all(problems)

    def _worst_pair_px(self, image: OrientedImage) -> float:
        """Largest distance of a check pair of the file from where the camera sees its ground point, px."""
        if not len(image.pairs):
            return 0.0
        lens = self.cameras[image.camera]
        seen = (image.pairs[:, 2:] - image.centre_m) @ image.axes
        with np.errstate(divide="ignore", invalid="ignore"):
            xy_px = lens.projected(seen[:, :2] / seen[:, 2:]) + np.array(lens.size_px) / 2
        return float(np.nan_to_num(np.linalg.norm(xy_px - image.pairs[:, :2], axis=1), nan=np.inf).max())
