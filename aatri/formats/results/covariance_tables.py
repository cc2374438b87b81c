"""Covariances of a Solution as tables: of points, with themselves and between them, and of orientations.

    point_covariances.csv    point_1 point_2, and the nine covariances of X Y Z of the first by those of the second, m^2
    image_covariances.csv    image, and the upper triangle by rows of the covariance matrix of X Y Z d1 d2 d3

d1 d2 d3 turn the image about the axes of the ground system, R <- exp([d]x) R, in rad. What is not determined has no
row.
"""

from collections.abc import Mapping
from itertools import combinations_with_replacement, product
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.artifacts.solution import Solution

AXES = ("X", "Y", "Z")
OF_IMAGES = ("X_m", "Y_m", "Z_m", "d1_rad", "d2_rad", "d3_rad")


def covariance_tables(solution: Solution) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
    """Columns of the tables by the names of their files; a table without rows is none."""
    points, between, images = solution.points, solution.point_covariances, solution.images
    first, second, matrices = points.id, points.id, points.covariance_m2
    if between is not None:
        pairs = between.first != between.second
        first = np.concatenate([first, points.id[between.first[pairs]]])
        second = np.concatenate([second, points.id[between.second[pairs]]])
        matrices = np.concatenate([matrices, between.covariance_m2[pairs]])
    tables: dict[str, Mapping[str, npt.NDArray[Any]]] = {}
    kept = np.isfinite(matrices).all(axis=(1, 2))
    if kept.any():
        cells = {f"{AXES[i]}{AXES[j]}_m2": matrices[kept, i, j] for i, j in product(range(3), repeat=2)}
        tables["point_covariances.csv"] = {"point_1": first[kept], "point_2": second[kept], **cells}
    kept = np.isfinite(images.covariance).all(axis=(1, 2))
    if kept.any():
        cells = {
            f"{OF_IMAGES[i]}_{OF_IMAGES[j]}": images.covariance[kept, i, j]
            for i, j in combinations_with_replacement(range(6), 2)
        }
        tables["image_covariances.csv"] = {"image": images.id[kept], **cells}
    return tables
