"""Pixel conventions: where corners, centres and the middle of the image lie."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.camera.pixels import half_format_mm, mm_from_pixel
from aatri.errors import InputError

SIZE, FORMAT = np.array([0.01, 0.02]), np.array([600.0, 400.0])


# the upper right corner of the image, 3 mm right of and 4 mm above its centre, in each convention
@pytest.mark.parametrize(
    ("origin", "y", "pixel"),
    [
        ("top-left-corner", "down", [600.0, 0.0]),
        ("top-left-corner", "up", [600.0, 0.0]),
        ("top-left-centre", "down", [599.5, -0.5]),
        ("top-left-centre", "up", [599.5, 0.5]),
        ("bottom-left-corner", "up", [600.0, 400.0]),
        ("bottom-left-corner", "down", [600.0, -400.0]),
        ("image-centre", "up", [300.0, 200.0]),
        ("image-centre", "down", [300.0, -200.0]),
    ],
)
def test_the_upper_right_corner(origin: str, y: str, pixel: list[float]) -> None:
    matrix = mm_from_pixel(SIZE, origin, y, FORMAT)
    assert matrix @ [*pixel, 1.0] == pytest.approx([3.0, 4.0], abs=1e-12)


@pytest.mark.parametrize(
    ("size", "origin", "y", "form", "told"),
    [
        (SIZE, "centre", "down", FORMAT, "pixel origin"),
        (SIZE, "image-centre", "", FORMAT, "pixel y"),
        (SIZE * np.nan, "image-centre", "up", FORMAT, "pixel size"),
        (SIZE, "top-left-corner", "down", FORMAT * np.nan, "format"),
    ],
)
def test_what_is_missing_is_named(size: np.ndarray, origin: str, y: str, form: np.ndarray, told: str) -> None:
    with pytest.raises(InputError, match=told):
        mm_from_pixel(size, origin, y, form)


def test_half_format_of_film_and_digital_cameras() -> None:
    found = half_format_mm(np.array([True, False]), np.array([[600.0, 400.0], [230.0, 230.0]]), np.full((2, 2), 0.01))
    assert found.tolist() == [[3.0, 2.0], [115.0, 115.0]]
