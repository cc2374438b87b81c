"""MicMac's samples: their own check pairs, the same block in both versions; what is wrong is refused with its place."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from aatri.errors import AatriError, InputError
from aatri.formats.micmac.reader import read_micmac, read_project
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.format import Reading
from tests.formats.lens_projection import misfit_px

GROUND = "Saisies-MMV1/Ground-Pts3D.xml"
MEASURED = "Saisies-MMV1/GroundMeasure.xml"
V1 = "Saisies-MMV1/Ori-Ground_mm3d"
MMVII = "Saisies-MMV1/MMVII-PhgrProj"
IMAGE, OTHER = (f"Orientation-IMGP{k}.JPG.xml" for k in (4167, 4168))
CAMERA = "AutoCal_Foc-28000_Cam-PENTAX_K5.xml"


@pytest.fixture
def samples(interchange: Path) -> Path:
    return interchange / "micmac"


def orientations(samples: Path, tmp_path: Path, folder: str) -> Path:
    """A copy of an orientation folder, to be damaged."""
    copy = tmp_path / "Ori"
    shutil.copytree(samples / folder, copy)
    return copy


@pytest.mark.parametrize(("folder", "images"), [(V1, 4), ("Ori-MMV1", 7)])
def test_the_ten_pairs_of_each_file_are_projected_within_a_thousandth(
    samples: Path, tmp_path: Path, folder: str, images: int
) -> None:
    """By the camera as MicMac states it, and by that of the block: an affinity beside a strong distortion is exact."""
    path = orientations(samples, tmp_path, folder)
    project = read_project(path)
    assert len(project.images) == images
    block = assembled([read_micmac(path, Reading(lens_misfit_px=0.0))])
    for image in project.images:
        assert len(image.pairs) == 10
        lens = project.cameras[image.camera]
        u = (image.pairs[:, 2:] - image.centre_m) @ image.axes
        exact = lens.projected(u[:, :2] / u[:, 2:]) + np.array(lens.size_px) / 2
        assert np.abs(exact - image.pairs[:, :2]).max() < 1e-9
        assert misfit_px(block, image.name, image.pairs[:, :2], image.pairs[:, 2:]).max() < 1e-9


def test_both_versions_are_one_block(samples: Path) -> None:
    """The distortion of the second is MMVII's own fit of 4 terms by 3: 0.004 px off, 0.12 px in the corners."""
    first = read_project(samples / V1)
    second = read_project(samples / MMVII)
    later = {image.name: image for image in second.images}
    for image in first.images:
        np.testing.assert_allclose(later[image.name].axes, image.axes, rtol=0, atol=1e-14)
        np.testing.assert_allclose(later[image.name].centre_m, image.centre_m, rtol=0, atol=1e-14)
        lens, other = first.cameras[image.camera], second.cameras[later[image.name].camera]
        grid = np.stack(np.meshgrid(np.linspace(-864, 864, 9), np.linspace(-576, 576, 7)), axis=-1).reshape(-1, 2)
        rays = lens.ideal(grid)
        apart = np.abs(other.projected(rays) - grid).max(axis=1)
        assert np.median(apart) < 0.01
        assert apart.max() < 0.15
    marks = {(m.image, m.point): m.xy_px for m in read_project(samples / MEASURED).marks}
    assert {(m.image, m.point) for m in second.marks} == set(marks)
    for m in second.marks:
        np.testing.assert_allclose(m.xy_px, marks[m.image, m.point], rtol=0, atol=1e-12)
    targets = {t.point: t for t in read_project(samples / GROUND).targets}
    for t in second.targets:
        np.testing.assert_allclose(t.xyz_m, targets[t.point].xyz_m, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(t.covariance_m2, targets[t.point].covariance_m2)


def test_orientations_marks_and_ground_points_join_to_a_block(samples: Path) -> None:
    block = assembled([read_micmac(samples / name) for name in (V1, MEASURED, GROUND)])
    assert len(block.images) == 4
    assert block.metrics()["control_points"] == 9
    ground = dict(zip(block.points.id[block.ground_points.point].tolist(), block.ground_points.xyz_m))
    for k, image in enumerate(block.images.id.tolist()):
        known = np.isin(block.points.id[block.image_points.point], list(ground))
        rows = np.flatnonzero((block.image_points.image == k) & known)
        xyz = [ground[str(block.points.id[p])] for p in block.image_points.point[rows]]
        assert misfit_px(block, image, block.image_points.xy[rows], xyz).max() < 3.0  # measured by hand


def test_a_project_with_two_orientations_asks_which(samples: Path) -> None:
    with pytest.raises(InputError, match=r"several folders with orientations: .*Ori-Ground_mm3d"):
        read_micmac(samples / "Saisies-MMV1")


DAMAGE = {
    "truncated": (IMAGE, slice(0, 900), r"4167.JPG.xml:\d+:\d+: no XML"),
    "other matrix": (IMAGE, ("-0.1623", "0.1623"), r"4167.JPG.xml:3: .*no rotation"),
    "other convention": (
        OTHER,
        ("eConvApero_DistM2C", "eConvAngPhotoMDegre"),
        r"4168.JPG.xml:\d+: the convention 'eConvAngPhotoMDegre'",
    ),
    "moved centre": (IMAGE, ("<Centre>5.2", "<Centre>5.3"), r"fall up to .* px"),
    "decimal comma": (IMAGE, ("<Centre>5.2", "<Centre>5,2"), r":\d+: Centre is '5,2.*decimal comma"),
    "not a number": (CAMERA, ("<F>2112.04115765381403", "<F>nan"), r":6: F is 'nan'"),
    "missing section": (CAMERA, ("SzIm", "Size"), r":3: CalibrationInternConique has no SzIm"),
    "other model": (CAMERA, ("ModRad", "ModUnif"), r":3: the distortion 'ModUnif' has no like"),
    "web page": (CAMERA, "<!DOCTYPE html><ExportAPERO/>", r":1: this is a web page"),
    "entity": (CAMERA, '<!DOCTYPE a [<!ENTITY x "y">]><ExportAPERO>&x;</ExportAPERO>', r":1: an entity of its own"),
    "other encoding": (CAMERA, b"<ExportAPERO>\xe9</ExportAPERO>", r":1: not utf-8"),
    "camera in metres": (CAMERA, ("2112.04115765381403", "0.028"), r"fall up to .* px"),
    "camera absent": (CAMERA, None, r"its camera AutoCal_Foc-28000_Cam-PENTAX_K5 is in none"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_files_are_refused_with_their_place(samples: Path, tmp_path: Path, damage: str) -> None:
    name, change, message = DAMAGE[damage]
    folder = orientations(samples, tmp_path, V1)
    path = folder / name
    text = path.read_text()
    if change is None:
        path.unlink()
    elif isinstance(change, bytes):
        path.write_bytes(change)
    elif isinstance(change, slice):
        path.write_text(text[change])
    else:
        path.write_text(text.replace(*change) if isinstance(change, tuple) else change)
    with pytest.raises(AatriError, match=message) as refused:
        read_micmac(folder)
    assert "fix: " in str(refused.value)


def test_a_camera_without_a_like_matters_if_an_image_is_of_it(samples: Path, tmp_path: Path) -> None:
    """Ori-MMV1 has a fisheye that none of its images was taken with."""
    folder = orientations(samples, tmp_path, "Ori-MMV1")
    assert list(read_project(folder).without_like) == ["AutoCal_Foc-11500_Cam-imx477imx477-1"]
    image = folder / "Orientation-Img0907.tif.xml"
    other = image.read_text().replace("AutoCal_Foc-60000_Cam-NIKON_D810", "AutoCal_Foc-11500_Cam-imx477imx477-1")
    image.write_text(other)
    with pytest.raises(AatriError, match=r"imx477-1.xml:7: the distortion 'ModUnif eModele_FishEye_10_5_5' has no"):
        read_project(folder)


def test_an_image_twice_is_refused(samples: Path, tmp_path: Path) -> None:
    text = (samples / MEASURED).read_text()
    part = text[text.index("     <MesureAppuiFlottant1Im>") : text.index("</MesureAppuiFlottant1Im>") + 26]
    path = tmp_path / "twice.xml"
    path.write_text(text.replace("</SetOfMesureAppuisFlottants>", f"{part}</SetOfMesureAppuisFlottants>"))
    with pytest.raises(AatriError, match=r"point I-of-I in image IMGP4170.JPG twice, first in line 5"):
        read_micmac(path)
