"""Inpho's .prj: a projected point, the active calibration, which way the matrices map, damaged files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.formats.inpho.reader import read_inpho
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.format import Reading
from aatri.geometry.rotations import rotation_from_angles
from aatri.progress import SILENT
from tests.formats.patb.test_patb import flight

HEAD = """$PROJECT 15.0.0
  $PROJECT_NAME : made
  $LINEAR_UNITS_OF_OBJECT : m
  $LINEAR_UNITS_OF_IMAGE : mm
  $ANGULAR_UNITS : deg
$END
$COORDINATE_SYSTEM_SET
  $ID : UTM
$END_COORDINATE_SYSTEM
$CAMERA_DEFINITION
  $ID : cam
  $ACTIVE_CALIBRATION : 2
  $CALIBRATION_SET :
    $ID : 1
    $FOCAL_LENGTH : 120.5
    $PRINCIPAL_POINT_PPA : 0 0
    $END
  $CALIBRATION_SET :
    $ID : 2
    $FOCAL_LENGTH : 100.5
    $PRINCIPAL_POINT_PPA : 0.25 -0.125
    $END
  $END
$END
"""
END = "$CONTROL_POINTS\n  P1 1 2 3 3 0 0 0\n$END_POINTS\n"


def photo(name: str, xyz: np.ndarray, matrix: np.ndarray) -> str:
    rows = "\n".join("    " + " ".join(f"{v:.12f}" for v in row) for row in matrix)
    place = " ".join(f"{v:.5f}" for v in xyz)
    return (
        f"$PHOTO\n  $PHOTO_NUM : {name}\n  $CAMERA_ID : cam\n"
        f"  $EXT_ORI : 12:00:00 01/01/2026\n    100.5 {place}\n{rows}\n"
        f"  $PHOTO_POINTS :\n    P{name} 1.5 -2.25 1.00 2 {{ * }}\n    Q 3.5 4.5 1.00 2 {{ }}\n  $END_POINTS\n$END\n"
    )


def project(*, transposed: bool = True) -> str:
    R, position = flight()
    stated = R.swapaxes(1, 2) if transposed else R
    return HEAD + "".join(photo(str(k), x, m) for k, (x, m) in enumerate(zip(position, stated), 1)) + END


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "block.prj"
    path.write_text(text)
    return path


@pytest.mark.parametrize("transposed", [False, True])
def test_a_point_is_projected_with_the_active_calibration(tmp_path: Path, transposed: bool) -> None:
    """x = x0 - c u / w, y = y0 - c v / w with (u, v, w) = R'(X - X0)."""
    R, position = flight()
    path = written(tmp_path, project(transposed=transposed))
    block = assembled([read_inpho(path, Reading(), SILENT)])
    assert block.cameras.principal_distance_mm.tolist() == [100.5]
    assert block.cameras.principal_point_mm.tolist() == [[0.25, -0.125]]
    ground = position[3] + [100.0, 40.0, -900.0]
    u = R[3].T @ (ground - position[3])
    expected = [0.25 - 100.5 * u[0] / u[2], -0.125 - 100.5 * u[1] / u[2]]
    k = block.images.id[block.exterior.image].tolist().index("4")
    turned = rotation_from_angles(block.exterior.angles_rad)[k].T @ (ground - block.exterior.position_m[k])
    seen = block.cameras.principal_point_mm[0] - 100.5 * turned[:2] / turned[2]
    np.testing.assert_allclose(seen, expected, rtol=0, atol=1e-5)
    assert len(block.image_points) == 20


def test_two_cameras_of_an_old_version_are_called_by_their_type(tmp_path: Path) -> None:
    """Version 5 has `$CAMERA` with `$TYPE`, which photos name as `$CAMERA_ID`."""
    old = "".join(
        f"$CAMERA\n  $TYPE : {name}\n  $KIND : CCDFrame\n  $FOCAL_LENGTH : {c}\n  $PRINCIPAL_POINT_PPA : 0 0\n$END\n"
        for name, c in (("nadir (50mm)", 100.5), ("oblique", 80.25))
    )
    head, photos = HEAD[: HEAD.index("$CAMERA_DEFINITION")], project().removeprefix(HEAD)
    first, rest = photos.split("$PHOTO\n", 2)[1:]
    first = first.replace(": cam", ": oblique").replace("    100.5", "    80.25")
    text = f"{head}{old}$PHOTO\n{first}$PHOTO\n{rest.replace(': cam', ': nadir (50mm)')}"
    parts = read_inpho(written(tmp_path, text))
    assert parts.cameras["id"] == ["nadir (50mm)", "oblique"]
    assert parts.cameras["principal_distance_mm"] == [100.5, 80.25]
    assert parts.images["camera"][:2] == ["oblique", "nadir (50mm)"]
    assert len(assembled([parts]).images) == len(parts.images["id"])


def test_what_is_not_read_is_told(tmp_path: Path) -> None:
    notes = read_inpho(written(tmp_path, project()), Reading(), SILENT).notes
    assert "not read: $CONTROL_POINTS, $COORDINATE_SYSTEM_SET; " in notes[0]
    strip = "$STRIP\n  $STRIP_ID : 1\n$END\n"
    assert "$STRIP" in read_inpho(written(tmp_path, project() + strip), Reading(), SILENT).notes[0]
    assert "image from ground, as the lines of the flight show" in notes[1]


DAMAGE = [
    (lambda t: t[: t.index("$END_POINTS\n$END\n$PHOTO")], r":\d+: \$PHOTO does not end"),
    (lambda t: t.replace("$END\n$PHOTO", "$PHOTO", 1), r":\d+: \$PHOTO begins before \$CAMERA_DEFINITION of line 10"),
    (lambda t: t.replace("OBJECT : m", "OBJECT : ft"), r":3: linear units of object: ft"),
    (lambda t: t.replace("$PHOTO_NUM : 2\n", "$PHOTO_NUM : 1\n"), r":\d+: photo 1 twice, first in line 26"),
    (lambda t: t.replace("CALIBRATION : 2", "CALIBRATION : 3"), r":13: calibration 3 is not among the 2"),
    (lambda t: t.replace("    100.5 ", "    120.5 ", 1), r":\d+: focal length 120.5, that of the camera is 100.5"),
    (lambda t: t.replace(": 100.5", ": -100.5"), r":20: focal length -100.5"),
    (lambda t: t.replace("1.5 -2.25", "1,5 -2.25", 1), r":\d+: '1,5': a decimal comma"),
    (lambda t: t.replace("0.25 -0.125", "0.25"), r":21: 1 word where 2 numbers of \$PRINCIPAL_POINT_PPA"),
]


@pytest.mark.parametrize(("change", "message"), DAMAGE)
def test_damaged_projects_are_refused_with_their_place(tmp_path: Path, change: object, message: str) -> None:
    assert callable(change)
    with pytest.raises(AatriError, match=message) as refused:
        assembled([read_inpho(written(tmp_path, change(project())), Reading(), SILENT)])
    assert "fix: " in str(refused.value)
