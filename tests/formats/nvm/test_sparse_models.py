"""One scene as NVM and COLMAP, the same up to a similarity; Bundler by a hand-made file; damaged files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError
from aatri.formats.colmap.reader import read_colmap
from aatri.formats.nvm.bundler_reader import read_bundler
from aatri.formats.nvm.nvm_model import read_nvm
from aatri.formats.parts.assembled import assembled
from aatri.geometry.rotations import rotation_from_angles
from tests.formats.lens_projection import misfit_px
from tests.formats.told import Told

NVM = """NVM_V3

2
a.jpg 1000 1 0 0 0 0 0 0 0.1 0
b.jpg 1000 1 0 0 0 1 0 0 0.1 0

5
0 0 5 9 9 9 2 0 0 0 0 1 0 -199.213 0
1 1 5 9 9 9 2 0 1 198.4345 198.4345 1 1 0 199.2130
-1 1 4 9 9 9 2 0 2 -247.0 247.0 1 2 -483 240
1 -1 4 9 9 9 2 0 3 247.0 -247.0 1 3 0 -248
0 1 6 9 9 9 2 0 4 0 166.2 1 4 -165.7 165.7
0
"""

BUNDLER = """# Bundle file v0.3
2 1
1000 -0.05 0.01
1 0 0
0 1 0
0 0 1
0 0 0
0 0 0
0 0 0
0 0 0
0 0 0
0 0 0
0.5 0.25 -5
255 255 255
1 0 7 99.9376171 49.96880859
"""


def written(tmp_path: Path, text: str, name: str = "model.nvm") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path


def test_a_model_may_have_no_points(tmp_path: Path) -> None:
    parts = read_nvm(written(tmp_path, NVM[: NVM.index("5\n0 0 5")] + "0\n\n0\n"))
    assert parts.images["id"] == ["a.jpg", "b.jpg"]
    assert len(parts.image_points["xy"]) == 0


def test_a_point_of_an_nvm_is_projected_by_its_formula(tmp_path: Path) -> None:
    """Image b, point 2: X = (0, 1, 5) in the camera; m y with (1 + 0.1 m^2) m = 0.2, m = 0.199213."""
    m = 0.199213
    assert (1 + 0.1 * m**2) * m == pytest.approx(0.2, abs=1e-5)
    block = assembled([read_nvm(written(tmp_path, NVM))])
    assert misfit_px(block, "b.jpg", [[0.0, 199.2130]], [[1.0, 1.0, 5.0]])[0] < 0.01
    assert misfit_px(block, "a.jpg", [[198.4345, 198.4345]], [[1.0, 1.0, 5.0]])[0] < 0.01


def test_of_several_models_the_largest_is_read_and_the_others_are_named(tmp_path: Path) -> None:
    small = "1\nc.jpg 900 1 0 0 0 0 0 0 0 0\n\n1\n0 0 5 9 9 9 1 0 0 0 0\n"
    told = Told()
    of_two = read_nvm(written(tmp_path, NVM.replace("2\na.jpg", small + "\n2\na.jpg")), reporter=told)
    alone = read_nvm(written(tmp_path, NVM))
    assert of_two.images["id"] == alone.images["id"] == ["a.jpg", "b.jpg"]
    np.testing.assert_array_equal(of_two.image_points["xy"], alone.image_points["xy"])
    assert any("2 models: that of 2 images is read, 1 image is left out: c.jpg" in line for line in told.lines)


def test_a_point_of_bundler_is_projected_by_its_formula(tmp_path: Path) -> None:
    """p = (0.1, 0.05), |p|^2 = 0.0125: f (1 - 0.05 * 0.0125 + 0.01 * 0.0125^2) p, y up; image 1 is not oriented."""
    g = 1 - 0.05 * 0.0125 + 0.01 * 0.0125**2
    assert 1000 * g * 0.1 == pytest.approx(99.93765625, abs=1e-4)
    (tmp_path / "list.txt").write_text("left.jpg 0 1000\nright.jpg\n")
    parts = read_bundler(written(tmp_path, BUNDLER, "bundle.out"))
    assert parts.images["id"] == ["left.jpg"]
    block = assembled([parts])
    assert misfit_px(block, "left.jpg", [[1000 * g * 0.1, 1000 * g * 0.05]], [[0.5, 0.25, -5.0]])[0] < 1e-9


@pytest.mark.slow
def test_nvm_and_colmap_of_one_scene_agree(interchange: Path) -> None:
    """Two reconstructions of the same photographs, each by its own program: residuals and shape, not digits."""
    folder = interchange / "sfm"
    nvm = assembled([read_nvm(folder / "VisualSFM_example.nvm")])
    colmap = read_colmap(folder / "colmap_example_model_txt")
    assert len(nvm.images) == len(colmap.images) == 11
    np.testing.assert_array_equal(nvm.cameras.format, np.tile([2832.0, 2128.0], (11, 1)))  # the size of the JPEGs
    ground = dict(zip(nvm.ground_points.point.tolist(), nvm.ground_points.xyz_m))
    for k, image in enumerate(nvm.images.id.tolist()):
        rows = np.flatnonzero(nvm.image_points.image == k)[:500]
        xyz = [ground[p] for p in nvm.image_points.point[rows].tolist()]
        assert np.median(misfit_px(nvm, image, nvm.image_points.xy[rows], xyz)) < 1.0
    a, b = (rotation_from_angles(block.exterior.angles_rad) for block in (nvm, colmap))
    names = [name.rpartition("/")[2] for name in nvm.images.id.tolist()]
    assert names == colmap.images.id.tolist()
    turned = np.einsum("nij,nkj->nik", a, b)
    apart = np.einsum("nij,kij->nk", turned, turned)
    assert np.degrees(np.arccos(np.clip((apart - 1) / 2, -1, 1))).max() < 2.5
    np.testing.assert_allclose(_shape(nvm.exterior.position_m), _shape(colmap.exterior.position_m), atol=0.05)


def _shape(xyz: np.ndarray) -> np.ndarray:
    """Distances between all points, the largest being 1."""
    d = np.linalg.norm(xyz[:, None] - xyz, axis=2)
    return np.asarray(d / d.max())


DAMAGE = {
    "truncated": (slice(0, 150), r":7: 5 points|the number of points is not there|points, and"),
    "other version": (("NVM_V3", "NVM_V2"), r":1: begins with 'NVM_V2', not NVM_V3"),
    "fixed calibration": (("NVM_V3", "NVM_V3 FixedK 1 2 3 4 5"), r":1: a calibration common to all"),
    "decimal comma": (("0.1 0\nb", "0,1 0\nb"), r":4: '0,1': a decimal comma"),
    "not a number": (("1000 1 0", "nan 1 0"), r":4: 'nan': not a finite number"),
    "image twice": (("b.jpg", "a.jpg"), r":5: image a.jpg twice, first in line 4"),
    "unknown image": (("2 0 0 0 0 1 0", "2 0 0 0 0 7 0"), r":8: image 7, but there are 2"),
    "a word too many": (("0 0 5 9 9 9 2", "0 0 5 9 9 9 2 8"), r":8: 16 words"),
    "no rotation": (("1000 1 0 0 0", "1000 0 0 0 0"), r":4: image a.jpg has the focal length 1000, quaternion"),
    "second model without images": (("\n0\n", "\n2\n"), r":13: 2 images, and 0 lines below"),
    "web page": ("<html><body>404</body></html>", r":1: this is a web page"),
    "archive": (b"PK\x03\x04.....", r"zip archive"),
    "other encoding": (b"NVM_V3\n\xff\xfe\xfa\n", r"neither UTF-8 nor"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_models_are_refused_with_their_place(tmp_path: Path, damage: str) -> None:
    change, message = DAMAGE[damage]
    path = written(tmp_path, NVM)
    if isinstance(change, bytes):
        path.write_bytes(change)
    elif isinstance(change, slice):
        path.write_text(NVM[change])
    else:
        path.write_text(NVM.replace(*change) if isinstance(change, tuple) else change)
    with pytest.raises(AatriError, match=message) as refused:
        read_nvm(path)
    assert "fix: " in str(refused.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("v0.3", "v0.4"), ":1: the first line is not"),
        (("2 1\n", "2 2\n"), ":2: 15 lines, where 2 images and 2 points need 18"),
        (("1 0 7", "1 1 7"), ":15: image 1 is not there, or not oriented"),
        (("1 0 0\n", "-1 0 0\n"), ":3: image 0: .*R is no rotation"),
        (("1000 ", "nan "), ":3: 'nan'"),
    ],
)
def test_damaged_bundle_files_are_refused_with_their_place(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    with pytest.raises(AatriError, match=message):
        read_bundler(written(tmp_path, BUNDLER.replace(*change), "bundle.out"))
