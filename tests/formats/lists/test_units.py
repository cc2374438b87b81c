"""Units that lists state: image coordinates in millimetres, and coordinates that are refused in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.conventions.pixel_origins import PHOTO_MM
from aatri.formats.lists.list_reader import read_list
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.format import Reading

IN_MM = [
    ("image,point,x_mm,y_mm,sx_um,sy_um", ""),
    ("Photo;Punkt;x [mm];y [mm];sx [um];sy [um]", ""),
    ("image point x y sx sy\n- - mm mm um um", ""),
    ("", "image point x_mm y_mm sx_um sy_um"),
]


@pytest.mark.parametrize(("header", "columns"), IN_MM)
def test_image_coordinates_in_mm_count_from_the_image_centre(tmp_path: Path, header: str, columns: str) -> None:
    """A camera of 6000 x 4000 pixels of 4 um: 2.4 mm to the right and 1.2 mm up are 600 columns and 300 rows."""
    separator = next((sign for sign in ",;" if sign in header), " ")
    path = tmp_path / "measured.txt"
    path.write_text(f"{header}\n" * bool(header) + separator.join(["a.jpg", "P1", "2.4", "1.2", "4", "8"]) + "\n")
    parts = read_list(path, Reading(columns=columns or None))
    assert parts.pixel_axes == PHOTO_MM
    lens = Lens("cam", "none", (6000.0, 4000.0), (9000.0, 9000.0), pixel_mm=0.004)
    camera = BlockParts("made", [Path("camera.txt")], **camera_parts([lens]))
    image = BlockParts("made", [Path("images.txt")], images={"id": ["a.jpg"], "camera": "cam"})
    block = assembled([image, camera, parts])
    assert block.cameras.pixel_origin.tolist() == ["top-left-corner"]
    np.testing.assert_allclose(block.image_points.xy, [[3600.0, 1700.0]], atol=1e-9)
    np.testing.assert_allclose(block.image_points.sigma_mm, [[0.004, 0.008]], atol=1e-12)


REFUSED = [
    ("point,X [mm],Y [mm],Z [mm]\nP,1,2,3\n", ":1: X in mm"),
    ("point,X (ft),Y (ft),Z (ft)\nP,1,2,3\n", ":1: X in ft"),
    ("image,point,x_mm,y\na,P,1,2\n", ":2: x in mm and y in px"),
    ("image,point,x_mm,y_mm,sx_um,sy_px\na,P,1,2,3,4\n", ":2: sx in um and sy in px"),
]


@pytest.mark.parametrize(("text", "message"), REFUSED)
def test_units_that_a_column_cannot_have_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "list.csv"
    path.write_text(text)
    with pytest.raises(AatriError, match=message):
        read_list(path, Reading())


def test_standard_deviations_have_each_its_own_unit_and_coordinates_in_um_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "list.csv"
    path.write_text("image,point,x_mm,y_mm,sx_um,sy_mm\na,P,1,2,4,0.008\n")
    np.testing.assert_allclose(read_list(path, Reading()).image_points["sigma_mm"], [[0.004, 0.008]], atol=1e-12)
    with pytest.raises(AatriError, match="image coordinates in um"):
        read_list(path, Reading(columns="image point x_um y_um sx_um sy_um"))
