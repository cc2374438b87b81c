"""A block folder in which points are measured: its images with their files, points, marks, and what clicks are there.

A click is a place in a file, px from the outer corner of its upper left pixel, x right, y down. In the tables it stands
in the pixel system of the camera, as block.yaml has it; of digital cameras with `photo` coordinates in mm from the
image centre.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from aatri.adapters.interior.image_pixels import of_camera
from aatri.arrays import Float
from aatri.artifacts.block import Cameras, Fiducials, GroundPoints
from aatri.camera.pixels import mm_from_pixel
from aatri.codes import CHECK, CONTROL
from aatri.errors import Faults, InputError, raise_all
from aatri.formats.tables.cameras import camera_tables
from aatri.formats.tables.covariances import read_covariances
from aatri.formats.tables.geographic import with_metric_frame
from aatri.formats.tables.ground import ground_point_columns, without_bodies
from aatri.formats.tables.settings.reading import read_settings
from aatri.formats.tables.source import Source
from aatri.formats.text.text_file import missing
from aatri.ids import OF_IDS, clipped, is_valid
from aatri.measuring.measured_table import MeasuredRow, MeasuredTable
from aatri.pixels.reading import TIFF, size_px

CORNER_PX = 0.5
"""From the outer corner of the first pixel to its centre."""
CLICK_SIGMA_PX = 0.5
"""Of a point set by hand, where block.yaml has no standard deviation of image points: half a pixel (Kraus, 5.1)."""
DECIMALS = 4
"""Of a written coordinate, px; of mm so many more that it is as sharp."""


@dataclass(frozen=True)
class GroundPlace:
    """Coordinates of a control or check point in the frame of the block; NaN where not given."""

    xyz_m: Float
    covariance_m2: Float
    role: str


class MeasuredFolder:
    """A block folder, as far as measuring needs it."""

    def __init__(self, folder: Path) -> None:
        """Read the folder.

        Raises
        ------
        InputError
            If it is no block folder, or names no file of an image.
        """
        if not folder.is_dir():
            remedy = "name the folder of block.yaml; of a run `aatri export RUN:block tables FOLDER` makes one"
            raise (
                InputError("is a file, not a block folder", where=str(folder), remedy=remedy)
                if folder.exists()
                else (missing(folder))
            )
        self.folder = folder
        settings, document = read_settings(folder / "block.yaml")
        self.settings = settings
        source = with_metric_frame(Source(folder, settings, document))
        camera = camera_tables(source)
        self.cameras: Cameras = camera.cameras
        self.fiducials: Fiducials = camera.fiducials
        images = source.table("images.csv")
        raise_all(source.problems)
        if images is None:
            raise missing(folder / "images.csv")
        row_of = {str(name): k for k, name in enumerate(self.cameras.id)}
        unknown = [name for name in images.text["camera"] if name not in row_of]
        if unknown:
            raise InputError(
                f"camera {clipped(unknown[0])!r} is unknown", where=str(images.path), remedy="see block.yaml"
            )
        self.images: list[str] = images.text["image"]
        self.camera = dict(zip(self.images, (row_of[name] for name in images.text["camera"])))
        self.path = {i: str(folder / p) if p else "" for i, p in zip(self.images, images.text["path"])}
        if not any(self.path.values()):
            remedy = "add a column path: the file of each photograph or scan, from the block folder"
            raise InputError(
                "no image has a path: there is nothing to measure in", where=str(images.path), remedy=remedy
            )
        self.crs = next(iter(source.settings.frames.values())).crs
        self._source = source
        self.points = MeasuredTable(folder / "image_points.csv", self._header("point", settings.sigma.image))
        fiducial = settings.sigma.fiducial or settings.sigma.image
        self.marks = MeasuredTable(folder / "fiducials.csv", self._header("fiducial", fiducial))
        self.ground: dict[str, GroundPlace] = {}
        self._ground_stamp = -1.0
        self.refresh_ground()

    def _header(self, name: str, default: float | None) -> tuple[str, ...]:
        return ("image", name, "x", "y", *(("sx", "sy") if default is None else ()))

    def refresh_ground(self) -> bool:
        """Read control and check points again if their file is another than last time; whether it was.

        Raises
        ------
        InputError
            If it breaks the contract by now.
        """
        path = self.folder / "ground_points.csv"
        stamp = path.stat().st_mtime if path.exists() else 0.0
        if stamp == self._ground_stamp:
            return False
        self.ground = self._ground()
        self._ground_stamp = stamp
        return True

    def _ground(self) -> dict[str, GroundPlace]:
        """Control and check points, with approximate ones."""
        source = replace(self._source, problems=Faults())
        table = without_bodies(source, source.table("ground_points.csv"))[0]
        columns = ground_point_columns(source, table, read_covariances(source))[0]
        raise_all(source.problems)
        if not columns:
            return {}
        rows = GroundPoints.of(
            point=np.arange(len(columns["point"])), **{k: columns[k] for k in ("xyz_m", "covariance_m2", "role")}
        )
        words = {CONTROL: "control", CHECK: "check"}
        return {
            name: GroundPlace(
                rows.xyz_m[k],
                rows.covariance_m2[k],
                next((words[r] for r in rows.role[k].tolist() if r in words), "point"),
            )
            for k, name in enumerate(columns["point"])
        }

    def table(self, kind: str) -> MeasuredTable:
        """The table of `point` or `fiducial`."""
        return self.marks if kind == "fiducial" else self.points

    def marks_of(self, image: str) -> dict[str, Float]:
        """Calibrated marks of the camera of an image, mm."""
        rows = self.fiducials.camera == self.camera[image]
        return dict(zip(self.fiducials.id[rows].tolist(), self.fiducials.xy_mm[rows]))

    def size_px(self, image: str) -> tuple[int, int] | None:
        """Width and height of a file as far as they are known without decoding it."""
        k = self.camera[image]
        width_height = self.cameras.format[k]
        if self.cameras.kind[k] == "digital" and np.isfinite(width_height).all():
            return int(width_height[0]), int(width_height[1])
        return size_px(self.path[image]) if self.path[image].lower().endswith(TIFF) else None

    def to_table(self, image: str, size_px: tuple[int, int]) -> Float:
        """Matrix (2, 3) from px from the outer corner of a file to the coordinates of the tables.

        Raises
        ------
        InputError
            If the camera's coordinates are no pixels of its file.
        """
        k, cameras = self.camera[image], self.cameras
        where, size, system = f"camera {cameras.id[k]}", np.array(size_px, float), str(cameras.image_coordinates[k])
        digital = cameras.kind[k] == "digital"
        if digital and np.isfinite(cameras.format[k]).all() and not np.array_equal(cameras.format[k], size):
            width, height = cameras.format[k].astype(int).tolist()
            what = (
                f"{self.path[image]} has {size_px[0]} x {size_px[1]} pixels, format in block.yaml is {width} x {height}"
            )
            raise InputError(what, where=where, remedy="name the file that was measured, or mend the format")
        if system == "pixel":
            matrix = of_camera(cameras, k, size)
        elif system == "photo" and digital and np.isfinite(cameras.pixel_size_mm[k]).all():
            matrix = mm_from_pixel(cameras.pixel_size_mm[k], "top-left-centre", "down", size)
        else:
            what = f"{system} coordinates of film in mm are not those of a click"
            remedy = "write image_coordinates: pixel and pixel: {size, origin, y} for the scans, as another camera"
            raise InputError(what, where=where, remedy=remedy)
        return np.column_stack([matrix[:, :2], matrix @ [-CORNER_PX, -CORNER_PX, 1.0]])

    def sigma_mm(self, row: MeasuredRow, kind: str) -> Float:
        """Standard deviations (2,) of a row on the image, mm; the default of block.yaml where it has none."""
        defaults, units = self.settings.sigma, self.settings.units
        default = defaults.image if kind == "point" else defaults.fiducial or defaults.image
        size = np.nan_to_num(self.cameras.pixel_size_mm[self.camera[row.image]], nan=1.0)
        sigma_mm = np.array(row.sigma) * [units.sigma_image_mm(float(s)) for s in size]
        missing_mm = (
            CLICK_SIGMA_PX * size
            if default is None
            else default * np.array([units.sigma_image_mm(float(s)) for s in size])
        )
        return np.where(np.isnan(sigma_mm), missing_mm, sigma_mm)

    def cells(self, kind: str, image: str, xy: Float, per_px: float, *, new: bool) -> dict[str, str]:
        """Cells of a click: coordinates, of a new row a standard deviation where block.yaml has none.

        Parameters
        ----------
        xy : (2,) float64
            In the coordinates of the table.
        per_px : float
            Length of a pixel in them.
        """
        digits = DECIMALS + max(0, int(np.ceil(-np.log10(per_px) - 1e-9)))
        written = {name: f"{value:.{digits}f}" for name, value in zip(("x", "y"), xy.tolist())}
        defaults = self.settings.sigma
        default = defaults.image if kind == "point" else defaults.fiducial or defaults.image
        if not new or default is not None:
            return written
        if not {"sx", "sy"} <= set(self.table(kind).header):
            what = f"no columns sx, sy, and no sigma.{kind if kind == 'fiducial' else 'image'} in block.yaml"
            remedy = "add sigma: {image: 0.5} to block.yaml, in its unit of sigma_image"
            raise InputError(what, where=str(self.table(kind).path), remedy=remedy)
        size = self.cameras.pixel_size_mm[self.camera[image]]
        factor = [self.settings.units.sigma_image_mm(float(s)) for s in size]
        return written | {n: f"{CLICK_SIGMA_PX * s / f:.6g}" for n, s, f in zip(("sx", "sy"), size, factor)}

    @staticmethod
    def check_name(name: str) -> None:
        """Refuse what is no id."""
        if not is_valid(name):
            raise InputError(f"{clipped(name)!r} is no id", remedy=OF_IDS)
