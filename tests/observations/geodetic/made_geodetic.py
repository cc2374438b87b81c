"""A block of one geodetic observation, for tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aatri.artifacts.block import Block, Geodetic, GroundPoints, ImagePoints
from aatri.formats.plain_block import image_table, pixel_cameras, plain_block


def geodetic_block(type_: str, ends: tuple[str, str], above: tuple[float, float], group: str = "") -> Block:
    """From A or image a to B or image b; an angle is at C. The value is 0.5 rad or 100 m."""
    angular = type_ in ("direction", "azimuth", "angle", "zenith")
    names = [{"point": p, "image": i}[kind] for kind, p, i in zip(ends, "AB", "ab")]

    def one(text: str) -> np.ndarray:
        return np.array([text])

    row = Geodetic(
        type=one(type_), start=one(names[0]), end=one(names[1]), via=one("C" if type_ == "angle" else ""),
        start_kind=one(ends[0]), end_kind=one(ends[1]), value=np.array([0.5 if angular else 100.0]),
        sigma=np.array([0.01]), set=one("s" if type_ == "direction" else ""), group=one(group),
        start_height_m=np.array([above[0]]), end_height_m=np.array([above[1]]), active=np.ones(1, dtype=bool),
        reduced=one("no"), file=np.zeros(1, np.int32), line=np.ones(1, np.int32),
    )  # fmt: skip
    images = image_table(["a", "b"], np.zeros(2, np.int32), np.arange(2.0), 0, np.ones(2, np.int32))
    camera = pixel_cameras(
        ids=["c"], pixel_size_mm=np.full((1, 2), 0.01), origin="image-centre", y="up", format_px=np.full((1, 2), 100.0),
        principal_distance_mm=np.ones(1), principal_point_mm=np.zeros((1, 2)), distortion=["none"],
    )  # fmt: skip
    return plain_block(name="one", files=[Path("one")], cameras=camera, images=images, point_ids=["A", "B", "C"],
                       image_points=ImagePoints.empty(), ground_points=GroundPoints.empty(), geodetic=row)  # fmt: skip
