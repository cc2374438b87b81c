"""BlocksExchange: a point projected by its formula, roles, damaged files."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation

from aatri.arrays import Float
from aatri.errors import AatriError
from aatri.formats.blocksexchange.reader import read_blocksexchange
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.format import Reading
from aatri.formats.registry.sources import read_all, read_source
from aatri.progress import SILENT
from tests.formats.lens_projection import misfit_px
from tests.formats.told import Told

TEXT = """<?xml version="1.0" encoding="utf-8"?>
<BlocksExchange version="2.1">
<SpatialReferenceSystems><SRS><Id>0</Id><Definition>EPSG:32650</Definition></SRS></SpatialReferenceSystems>
<Block><Name>b</Name><SRSId>0</SRSId>
<Photogroups><Photogroup><Name>cam</Name>
<ImageDimensions><Width>4000</Width><Height>3000</Height></ImageDimensions>
<CameraModelType>Perspective</CameraModelType>
<SensorSize>20</SensorSize><FocalLength>10</FocalLength>
<PrincipalPoint><x>2010</x><y>1490</y></PrincipalPoint>
<Distortion><K1>0.1</K1><K2>0.02</K2><K3>0</K3><P1>0.001</P1><P2>0.002</P2></Distortion>
<Photo><Id>0</Id><ImagePath>C:\\f\\a.jpg</ImagePath><Pose><Rotation>
<M_00>1</M_00><M_01>0</M_01><M_02>0</M_02><M_10>0</M_10><M_11>-1</M_11><M_12>0</M_12><M_20>0</M_20><M_21>0</M_21>
<M_22>-1</M_22></Rotation><Center><x>500010</x><y>4000020</y><z>120</z></Center></Pose></Photo>
<Photo><Id>1</Id><ImagePath>C:\\g\\a.jpg</ImagePath></Photo>
</Photogroup></Photogroups>
<ControlPoints>
<ControlPoint><SRSId>0</SRSId><Name>P</Name><Category>Vertical</Category><CheckPoint>false</CheckPoint>
<Position><x>500012</x><y>4000021</y><z>110</z></Position>
<HorizontalAccuracy>0.01</HorizontalAccuracy><VerticalAccuracy>0.02</VerticalAccuracy>
<Measurement><PhotoId>0</PhotoId><x>1</x><y>2</y></Measurement></ControlPoint>
<ControlPoint><Name>Q</Name><CheckPoint>true</CheckPoint><Position><x>500013</x><y>4000021</y><z>110</z></Position>
</ControlPoint>
</ControlPoints></Block></BlocksExchange>
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "block.xml"
    path.write_text(text)
    return path


def test_two_photogroups_of_one_name_are_two_cameras_and_one_without_photos_is_told(tmp_path: Path) -> None:
    group = TEXT[TEXT.index("<Photogroup>") : TEXT.index("</Photogroups>")]
    second = group.replace("<Id>0<", "<Id>8<").replace("<Id>1<", "<Id>9<").replace("a.jpg", "b.jpg")
    fisheye = group[: group.index("<Photo>")].replace("Perspective", "Fisheye") + "</Photogroup>"
    more = second.replace(">10</Focal", ">12</Focal") + fisheye + "</Photogroups>"
    parts = read_blocksexchange(written(tmp_path, TEXT.replace("</Photogroups>", more)))
    assert parts.notes == ["1 photogroup without photos not read"]
    block = assembled([parts])
    camera = dict(zip(block.images.id.tolist(), block.images.camera.tolist()))
    assert block.cameras.id.tolist() == ["cam", "cam 2"]
    assert camera == {"C:\\f\\a.jpg": 0, "C:\\g\\a.jpg": 0, "C:\\f\\b.jpg": 1, "C:\\g\\b.jpg": 1}
    assert block.cameras.principal_distance_mm.tolist() == [pytest.approx(10.0), pytest.approx(12.0)]


def test_a_point_is_projected_by_the_formula(tmp_path: Path) -> None:
    """f = 10 mm / 20 mm * 4000 px = 2000 px; P in the camera: (2, -1, 10), so u = 0.2, v = -0.1, r^2 = 0.05."""
    u, v, r2 = 0.2, -0.1, 0.05
    gain = 1 + 0.1 * r2 + 0.02 * r2**2
    x = 2010 + 2000 * (u * gain + 2 * 0.002 * u * v + 0.001 * (r2 + 2 * u * u))
    y = 1490 + 2000 * (v * gain + 2 * 0.001 * u * v + 0.002 * (r2 + 2 * v * v))
    parts = read_blocksexchange(written(tmp_path, TEXT))
    assert parts.images["id"] == ["C:\\f\\a.jpg", "C:\\g\\a.jpg"]
    block = assembled([parts])
    assert misfit_px(block, "C:\\f\\a.jpg", [[x, y]], [[500012.0, 4000021.0, 110.0]])[0] < 1e-6
    assert block.cameras.principal_distance_mm.tolist() == [pytest.approx(10.0)]
    np.testing.assert_array_equal(block.ground_points.role, [[3, 3, 1], [2, 2, 2]])


def test_control_of_another_system_is_converted_to_that_of_the_block(tmp_path: Path) -> None:
    longitude, latitude = pyproj.Transformer.from_crs(32650, 4326, always_xy=True).transform(500012.0, 4000021.0)
    text = TEXT.replace("</SRS></S", "</SRS><SRS><Id>1</Id><Definition>EPSG:4979</Definition></SRS></S")
    text = text.replace("<ControlPoint><SRSId>0", "<ControlPoint><SRSId>1")
    text = text.replace("<x>500012</x><y>4000021</y>", f"<x>{longitude!r}</x><y>{latitude!r}</y>")
    ground = read_blocksexchange(written(tmp_path, text)).ground_points
    np.testing.assert_allclose(ground["xyz_m"], [[500012, 4000021, 110], [500013, 4000021, 110]], rtol=0, atol=1e-6)
    assert np.sqrt(ground["covariance_m2"][0][2, 2]) == pytest.approx(0.02)


def test_the_system_of_a_list_of_control_holds_for_its_points(tmp_path: Path) -> None:
    east, north, _ = pyproj.Transformer.from_crs(32650, 32651, always_xy=True).transform(500012.0, 4000021.0, 110.0)
    text = TEXT.replace("</SRS></S", "</SRS><SRS><Id>1</Id><Definition>EPSG:32651</Definition></SRS></S")
    text = text.replace("<ControlPoints>", "<ControlPoints><SRSId>1</SRSId>")
    text = text.replace("<x>500013</x><y>4000021</y>", f"<x>{east!r}</x><y>{north!r}</y>")
    ground = read_blocksexchange(written(tmp_path, text)).ground_points
    np.testing.assert_allclose(ground["xyz_m"], [[500012, 4000021, 110]] * 2, rtol=0, atol=1e-6)


def test_what_a_category_does_not_know_and_names_may_be_missing_and_a_plane_of_its_own_is_local(tmp_path: Path) -> None:
    text = TEXT.replace("<x>500012</x><y>4000021</y>", "").replace("<Name>Q</Name>", "")
    parts = read_blocksexchange(written(tmp_path, text.replace("EPSG:32650", "ENU:39.97523,-83.00678")))
    assert parts.ground_points["point"] == ["P", "control 2"]
    np.testing.assert_array_equal(parts.ground_points["xyz_m"][0], [np.nan, np.nan, 110])
    assert assembled([parts]).ground_points.role.tolist() == [[0, 0, 1], [2, 2, 2]]
    assert parts.frame is not None
    assert parts.frame.crs == "local"
    assert parts.notes == ["its system is a plane at a place of its own (ENU), taken as a local one"]


def test_tie_points_of_a_file_beside_it_are_read_or_told_to_be_absent(tmp_path: Path) -> None:
    tie = "<TiePoint>\n<Measurement><PhotoId>0</PhotoId><x>5</x><y>6</y></Measurement></TiePoint>\n"
    path = written(tmp_path, TEXT.replace("</Block>", "<TiePoints><Path>D:\\x\\t.xml</Path></TiePoints></Block>"))
    assert read_blocksexchange(path).notes == ["tie points are not read: D:\\x\\t.xml is not beside the file"]
    (tmp_path / "t.xml").write_text(f'<?xml version="1.0"?>\n{tie}{tie}')
    ((_, parts),) = zip(*read_all([tmp_path], [], (told := Told())))
    assert parts.image_points["point"] == ["P", "tie 1", "tie 2"]
    assert list(zip(parts.image_points["file"], parts.image_points["line"])) == [(0, 20), (1, 3), (1, 5)]
    assert not any("not read" in line for line in told.lines)
    for text, fault in ((tie.replace("<x>5", "<x>5,5"), "t.xml:2: x is '5,5'"), ("<a/>", "t.xml has no TiePoint")):
        (tmp_path / "t.xml").write_text(text)
        with pytest.raises(AatriError, match=fault):
            read_blocksexchange(path)


def test_a_zipped_file_is_read_as_it_is(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "block.xmlz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("block.xml", TEXT.replace("<K1>0.1", "<K1>0,1"))
    with pytest.raises(AatriError, match=r"block.xmlz/block.xml:10: K1 is '0,1'|block.xmlz:10: K1 is '0,1'"):
        read_source(tmp_path / "block.xmlz", Reading(), SILENT)


DESCRIBED = """<M_00>-0.9999982912233401</M_00><M_01>-0.001636319085375301</M_01><M_02>-0.0008602425863163225</M_02>
<M_10>-0.001631068695467463</M_10><M_11>0.9999802528616577</M_11><M_12>-0.00606906089589293</M_12>
<M_20>0.0008701565192966738</M_20><M_21>-0.006067647409696231</M_21><M_22>-0.9999812130648239</M_22>"""
"""A rotation of the format's description, version 2.1; there too as omega, phi, kappa."""


def rotation(tmp_path: Path, inner: str, orientation: str = "XRightYDown") -> Float:
    """Image to ground of the first photo, y up, with another rotation."""
    matrix = TEXT[TEXT.index("<M_00>") : TEXT.index("</Rotation>")]
    text = TEXT.replace(matrix, inner)
    text = text.replace("<PrincipalPoint>", f"<CameraOrientation>{orientation}</CameraOrientation><PrincipalPoint>")
    return np.asarray(read_blocksexchange(written(tmp_path, text)).exterior["ground_from_image"][0])


def test_the_matrix_and_the_angles_of_the_description_are_one_rotation(tmp_path: Path) -> None:
    angles = "<Omega>179.6523471469934</Omega><Phi>0.04985630236313049</Phi><Kappa>179.9065465708369</Kappa>"
    np.testing.assert_allclose(rotation(tmp_path, angles), rotation(tmp_path, DESCRIBED), rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    ("ypr", "right", "up"),
    [
        ((0, 0, 0), (1, 0, 0), (0, 0, 1)),  # looks north, level
        ((90, 0, 0), (0, -1, 0), (0, 0, 1)),  # clockwise: looks east
        ((0, -90, 0), (1, 0, 0), (0, 1, 0)),  # looks straight down, its upper edge to the north
        ((90, -90, 0), (0, -1, 0), (1, 0, 0)),
        ((0, 0, 90), (0, 0, 1), (-1, 0, 0)),  # its right side goes up: clockwise to whom it looks at
    ],
)
def test_yaw_pitch_roll_turn_a_camera_that_looks_along_y(
    tmp_path: Path, ypr: tuple[int, ...], right: tuple[int, ...], up: tuple[int, ...]
) -> None:
    text = "".join(f"<{name}>{angle}</{name}>" for name, angle in zip(("Yaw", "Pitch", "Roll"), ypr))
    np.testing.assert_allclose(rotation(tmp_path, text)[:, :2].T, [right, up], rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("orientation", "x", "y"),
    [("XRightYUp", (1, 0), (0, 1)), ("XLeftYDown", (-1, 0), (0, -1)), ("XDownYRight", (0, -1), (1, 0)),
     ("XUpYLeft", (0, 1), (-1, 0))],
)  # fmt: skip
def test_axes_of_the_camera_are_those_of_its_orientation(
    tmp_path: Path, orientation: str, x: tuple[int, ...], y: tuple[int, ...]
) -> None:
    """M is the identity, so that east and north are where x and y of the camera point; right and up of the image."""
    unit = "".join(f"<M_{i}{j}>{int(i == j)}</M_{i}{j}>" for i in range(3) for j in range(3))
    np.testing.assert_array_equal(rotation(tmp_path, unit, orientation)[:2, :2], [x, y])


def test_millimetres_are_those_of_the_description(tmp_path: Path) -> None:
    """Its camera and its measurement, there in px and in mm."""
    group = """<ImageDimensions><Width>9420</Width><Height>14430</Height></ImageDimensions><PixelSize>0.0072</PixelSize>
<FocalLength>100.735601903992</FocalLength><PrincipalPoint><xmm>-0.1853590176</xmm><ymm>0.06130152144</ymm>
</PrincipalPoint>"""
    text = TEXT.replace(TEXT[TEXT.index("<ImageD") : TEXT.index("<Distortion>")], group)
    text = text.replace("<x>1</x><y>2</y>", "<xmm>18.6231910176</xmm><ymm>-4.48973352144</ymm>")
    parts = read_blocksexchange(written(tmp_path, text))
    np.testing.assert_allclose(parts.image_points["xy"], [[7270.31, 6599.44]], rtol=0, atol=1e-6)
    assert parts.cameras["principal_distance_mm"] == [pytest.approx(100.735601903992)]


def test_positions_in_metadata_are_told(tmp_path: Path) -> None:
    text = TEXT.replace("a.jpg</ImagePath></Photo>", "a.jpg</ImagePath><Pose><Metadata/></Pose></Photo>")
    assert read_blocksexchange(written(tmp_path, text)).notes == [
        "positions in the metadata of 1 photo are not read: C:\\g\\a.jpg"
    ]


DAMAGE = [
    (TEXT[:900], r":\d+:\d+: no XML"),
    (TEXT.replace('"2.1"', '"1.0"'), r":2: version '1.0'"),
    (TEXT.replace("<M_22>-1", "<M_22>1"), r":11: the matrix is no rotation"),
    (TEXT.replace("Perspective", "Fisheye"), r":7: the camera model 'Fisheye'"),
    (TEXT.replace("<SensorSize>20</SensorSize>", ""), r":5: image 4000 x 3000, focal length 0 px"),
    (TEXT.replace("<K1>0.1", "<K1>0,1"), r":10: K1 is '0,1': a decimal comma"),
    (TEXT.replace("<K3>0<", "<Direct>false</Direct><K3>0<"), r":10: Direct false of a distortion is not read"),
    (TEXT.replace("<Block>", "<Block/><Block>"), r":4: 2 blocks: b"),
    (TEXT.replace("<M_00>1<", "<Heading>1<").replace("</M_00>", "</Heading>"), r":11: a rotation of Heading, M_01"),
    (TEXT.replace("<Photogroup>", "<Photogroup><SRSId>1</SRSId>"), r":5: a photogroup in another system"),
    (TEXT.replace("<K1>0.1", "<K1>nan"), r":10: K1 is 'nan'"),
    (TEXT.replace("<Id>1<", "<Id>0<"), r":14: photo Id 0 twice, first in line 11"),
    (TEXT.replace("<Name>Q", "<Name>P"), r":21: point P twice, first in line 17"),
    (TEXT.replace("<PhotoId>0", "<PhotoId>7"), r":20: PhotoId 7 is no photo"),
    (TEXT.replace("<ControlPoint><SRSId>0", "<ControlPoint><SRSId>4"), r":17: SRSId 4 is not among the systems"),
    (TEXT.replace("Vertical<", "Upward<"), r":17: category 'Upward'"),
    (TEXT.replace("0.02</V", "-0.02</V"), r":17: standard deviations 0.01, -0.02"),
    (TEXT.replace("<HorizontalAccuracy>0.01</HorizontalAccuracy>", "").replace("0.02</V", "-0.02</V"), r"nan, -0.02"),
    (TEXT.replace("EPSG:32650", "EPSG:999999"), r":3: the system 'EPSG:999999' is not understood"),
    ("<html></html>", r":1: this is a web page"),
    ('<!DOCTYPE a [<!ENTITY x "y">]><BlocksExchange version="2.1">&x;</BlocksExchange>', r":1: an entity of its own"),
]


@pytest.mark.parametrize(("text", "message"), DAMAGE)
def test_damaged_files_are_refused_with_their_place(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(AatriError, match=message) as refused:
        read_blocksexchange(written(tmp_path, text))
    assert "fix: " in str(refused.value)


def with_open_points(aspect: str, skew: str, angles: str, *, points: int = 8) -> tuple[str, list[list[float]]]:
    """A photo that looks down and its measured points, projected by the formula of the way; f = 2000 px."""
    omega, phi, kappa = np.radians([2.0, -3.0, 40.0])
    c, s = np.cos, np.sin
    rx = np.array([[1, 0, 0], [0, c(omega), -s(omega)], [0, s(omega), c(omega)]])
    ry = np.array([[c(phi), 0, s(phi)], [0, 1, 0], [-s(phi), 0, c(phi)]])
    rz = np.array([[c(kappa), -s(kappa), 0], [s(kappa), c(kappa), 0], [0, 0, 1]])
    camera_from_ground = (rx @ ry @ rz).T
    if angles == "described":  # the same numbers, axes x right, y down: the photo looks up
        heights = 130.0
    else:
        camera_from_ground, heights = np.diag([1, -1, -1]) @ camera_from_ground, 110.0
    fy = 2000 * 1.001 if aspect == "a f" else 2000 / 1.001
    shear = 1.5 / 2000 if skew == "px" else 1.5e-3
    written, ties, marks = "1.5" if skew == "px" else "0.0015", "", []
    for k in range(points):
        place = np.array([500010.0 + (k % 3) * 3 - 3, 4000020.0 + (k // 3) * 2 - 2, heights])
        x, y, z = camera_from_ground @ (place - [500010.0, 4000020.0, 120.0])
        u, v = x / z, y / z
        gain = 1 - 0.01 * (u * u + v * v) + 0.001 * (u * u + v * v) ** 2
        ud = u * gain + 2 * 0.0002 * u * v + 0.0001 * (3 * u * u + v * v)
        vd = v * gain + 2 * 0.0001 * u * v + 0.0002 * (u * u + 3 * v * v)
        marks.append([*place, 2010 + 2000 * (ud + shear * vd), 1490 + fy * vd])
        X, Y, Z, column, row = map(float, marks[-1])
        ties += f"<TiePoint><Position><x>{X!r}</x><y>{Y!r}</y><z>{Z!r}</z></Position>"
        ties += f"<Measurement><PhotoId>0</PhotoId><x>{column!r}</x><y>{row!r}</y></Measurement></TiePoint>"
    matrix = TEXT[TEXT.index("<M_00>") : TEXT.index("</Rotation>")]
    text = TEXT.replace(matrix, "<Omega>2</Omega><Phi>-3</Phi><Kappa>40</Kappa>")
    weaker = {"<K1>0.1": "<K1>-0.01", "<K2>0.02": "<K2>0.001", "<P1>0.001": "<P1>0.0001", "<P2>0.002": "<P2>0.0002"}
    for strong, weak in weaker.items():
        text = text.replace(strong, weak)
    text = text.replace("<Photo><Id>0", f"<AspectRatio>1.001</AspectRatio><Skew>{written}</Skew><Photo><Id>0", 1)
    return text.replace("</Block>", f"<TiePoints>{ties}</TiePoints></Block>"), marks


@pytest.mark.parametrize("aspect", ["a f", "f / a"])
@pytest.mark.parametrize("skew", ["px", "of f"])
@pytest.mark.parametrize("angles", ["other", "described"])
def test_aspect_skew_and_angles_are_read_as_the_points_of_the_file_show(
    tmp_path: Path, aspect: str, skew: str, angles: str
) -> None:
    text, marks = with_open_points(aspect, skew, angles)
    block = assembled([read_blocksexchange(written(tmp_path, text), Reading(lens_misfit_px=0.08))])
    xyz, xy = np.array(marks)[:, :3], np.array(marks)[:, 3:]
    assert misfit_px(block, "C:\\f\\a.jpg", xy, xyz).max() < 0.08


@pytest.mark.parametrize("sense", [-1, 1])
def test_roll_turns_as_the_points_of_the_file_show(tmp_path: Path, sense: int) -> None:
    """The rotation of omega, phi, kappa 2, -3, 40 as Rz(-yaw) Rx(pitch) Ry(sense roll) Rx(90)."""
    text, marks = with_open_points("a f", "px", "other")
    turns = Rotation.from_euler("XYZ", [2, -3, 40], degrees=True) * Rotation.from_euler("X", -90, degrees=True)
    yaw, pitch, roll = turns.as_euler("ZXY", degrees=True) * [-1, 1, sense]
    ypr = f"<Yaw>{yaw:.12f}</Yaw><Pitch>{pitch:.12f}</Pitch><Roll>{roll:.12f}</Roll>"
    text = text.replace("<Omega>2</Omega><Phi>-3</Phi><Kappa>40</Kappa>", ypr)
    block = assembled([read_blocksexchange(written(tmp_path, text), Reading(lens_misfit_px=0.08))])
    assert misfit_px(block, "C:\\f\\a.jpg", np.array(marks)[:, 3:], np.array(marks)[:, :3]).max() < 0.08


def test_an_affinity_that_no_point_confirms_is_refused_and_angles_are_as_described(tmp_path: Path) -> None:
    text, _ = with_open_points("a f", "px", "other", points=2)
    with pytest.raises(AatriError, match="2 measured points of posed photos do not show which"):
        read_blocksexchange(written(tmp_path, text))
    of_angles = text.replace("<AspectRatio>1.001<", "<AspectRatio>1<").replace("<Skew>1.5<", "<Skew>0<")
    (note,) = read_blocksexchange(written(tmp_path, of_angles)).notes
    assert note.startswith("angles of rotations read as the format describes them, one of two ways: 2 measured points")
