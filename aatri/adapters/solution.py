"""Pieces of a Solution that every method fills in the same way."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Float, Int, Text, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.residuals import Residuals
from aatri.artifacts.solution import ImageOrientations, Solution, SolvedCameras, SolvedPoints
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.errors import ArtifactError
from aatri.tables.schema import Table, columns_of

T = TypeVar("T", bound=Table)


def check_same_block(block: Block, **ports: ImagePoints | Models | Strips | Solution | None) -> None:
    """Refuse an artifact that was made from another block: its images are others.

    Parameters
    ----------
    ports : artifacts by the name of their port
        None where a port has none.

    Raises
    ------
    ArtifactError
    """
    for port, artifact in ports.items():
        if artifact is not None and not np.array_equal(artifact.images.id, block.images.id):
            raise ArtifactError(
                f"{port} belongs to another block than {block.name}: its images differ",
                remedy="check `from` in pipeline.yaml",
            )


def oriented_images(
    block: Block, position_m: Float, ground_from_image: Float, used: Int, covariance: Float | None = None
) -> ImageOrientations:
    """Orientation table; an image is oriented where its position is finite.

    Parameters
    ----------
    position_m : (n, 3) float64, m
    ground_from_image : (n, 3, 3) float64
    used : (n,) int
        Image points used.
    covariance : (n, 6, 6) float64, optional
    """
    return ImageOrientations.of(
        id=block.images.id,
        oriented=finite_rows(position_m),
        position_m=position_m,
        ground_from_image=ground_from_image,
        covariance=np.nan if covariance is None else covariance,
        image_points=used,
    )


def ground_points(block: Block, xyz_m: Float, rays: Int, covariance_m2: Float | None = None) -> SolvedPoints:
    """Point table."""
    covariance_m2 = np.full((len(xyz_m), 3, 3), np.nan) if covariance_m2 is None else covariance_m2
    return SolvedPoints(block.points.id, xyz_m, covariance_m2, rays)


def solved_cameras(block: Block) -> SolvedCameras:
    """Cameras as the block gives them."""
    return SolvedCameras(
        id=block.cameras.id,
        principal_distance_mm=block.cameras.principal_distance_mm,
        principal_point_mm=block.cameras.principal_point_mm,
    )


def residuals(
    kind: str,
    row: Int,
    image: Text,
    point: Text,
    value: Float,
    sigma: Float,
    active: Bool | None = None,
    unit: str | Text | None = None,
) -> Residuals:
    """Residuals of one kind; values of fewer than three coordinates are filled with NaN.

    Parameters
    ----------
    row : (n,) int
    image, point : (n,) str
    value, sigma : (n, m) float64
    active : (n,) bool, optional
    unit : str or (n,) str, optional
        Of value and sigma; default mm for image points, else m.
    """
    unit = unit if unit is not None else "mm" if kind == "image_point" else "m"
    filled = (np.pad(values, ((0, 0), (0, 3 - values.shape[1])), constant_values=np.nan) for values in (value, sigma))
    residual, sigma = filled
    used = True if active is None else active
    return Residuals.of(
        kind=kind, row=row, image=image, point=point, residual=residual, sigma=sigma, active=used, unit=unit
    )


def stacked(tables: Sequence[T]) -> T:
    """Tables of one class, one below the other."""
    cls = type(tables[0])
    columns = {name: [getattr(t, name) for t in tables] for name in columns_of(cls)}
    del tables  # a column that has been put together is not kept: residuals of all image points are large
    return cls(**{name: np.concatenate(columns.pop(name)) for name in columns_of(cls)})


def suspect_rows(
    stage: str,
    kind: str,
    *,
    image: Text,
    point: Text,
    row: npt.ArrayLike = -1,
    size: npt.ArrayLike = np.nan,
    unit: str = "mm",
    sigma: npt.ArrayLike = np.nan,
    test: npt.ArrayLike = np.nan,
    verdict: str = "rejected",
) -> Suspects:
    """Suspects of one kind and verdict, named by a stage.

    Parameters
    ----------
    image, point : (n,) str
        Ids.
    row, size, sigma, test : (n,) or one for all
    """
    of_all = {"kind": kind, "stage": stage, "unit": unit, "verdict": verdict}
    return Suspects.of(row=row, image=image, point=point, size=size, sigma=sigma, test=test, **of_all)


def rejected_rows(suspects: Suspects, image_points: ImagePoints) -> Bool:
    """Measurements that an earlier stage has rejected, (n,) bool by row of the measurements."""
    rejected = np.zeros(len(image_points.measurements), dtype=bool)
    chosen = (suspects.kind == "image_point") & suspects.staying_out & (suspects.row >= 0)
    rejected[suspects.row[chosen]] = True
    return rejected
