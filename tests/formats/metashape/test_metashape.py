"""Metashape's documents: a point falls where the manual's formula puts it; pinned marks; rigs; frames.

The fragment FLIGHT is from a real document (version 2.0, DJI FC6310; open-forest-observatory/geograypher, BSD-3): the
pose of one image, its chunk, and what its GNSS and gimbal said.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.codes import CHECK, CONTROL, NO_ROLE, OBSERVED_VALUE
from aatri.errors import AatriError
from aatri.formats.conventions.poses import carrier_angles
from aatri.formats.metashape.reader import read_metashape
from aatri.formats.parts.assembled import assembled
from aatri.formats.registry.recognised import recognised_file
from aatri.geometry.rotations import rotation_from_angles
from aatri.observations.rigs import rig_pairs
from tests.formats.lens_projection import misfit_px

NEW = """<f>3000</f><cx>10</cx><cy>-20</cy><b1>3</b1><b2>0</b2>
<k1>-0.05</k1><k2>0.01</k2><p1>0.001</p1><p2>-0.002</p2>"""
OLD = """<fx>3003</fx><fy>3000</fy><cx>2010</cx><cy>1480</cy><skew>0</skew>
<k1>-0.05</k1><k2>0.01</k2><p1>0.001</p1><p2>-0.002</p2>"""
TEXT = """<?xml version="1.0" encoding="UTF-8"?>
<document version="{version}">
<chunk label="Chunk 1" enabled="true">
<sensors>
<sensor id="0" label="cam" type="frame">
<resolution width="4000" height="3000"/>
<property name="pixel_width" value="0.004"/>
<calibration type="frame" class="initial"><f>2900</f></calibration>
<calibration type="frame" class="adjusted"><resolution width="4000" height="3000"/>{calibration}</calibration>
</sensor>
<sensor id="1" label="slave" type="frame" master_id="0">
<resolution width="4000" height="3000"/>
<calibration type="frame" class="adjusted"><resolution width="4000" height="3000"/>{calibration}</calibration>
<rotation>1 0 0 0 0.8 -0.6 0 0.6 0.8</rotation><translation>0.5 0.25 0</translation>
</sensor>
</sensors>
<cameras>
<camera id="7" sensor_id="0" label="a.jpg" enabled="true">
<transform>1 0 0 10 0 -1 0 20 0 0 -1 50 0 0 0 1</transform>
<reference x="21.5" y="42" z="105" sx="0.02" sy="0.03" sz="0.05" enabled="true"/>
</camera>
<group id="0"><camera id="8" sensor_id="1" master_id="7" label="b.jpg"/></group>
<camera id="9" sensor_id="0" label="c.jpg" enabled="false"/>
</cameras>
<markers>
<marker id="0" label="P1"><reference x="23" y="38" z="4" sxyz="0.5" enabled="true"/></marker>
<marker id="1" label="P2"><reference x="1" y="2" z="3" enabled="false"/></marker>
<marker id="2" label="T3"/>
</markers>
<frames><frame id="0"><markers>
<marker marker_id="0"><location camera_id="7" pinned="true" x="2200.5" y="1600"/>
<location camera_id="8" pinned="false" x="100" y="100"/></marker>
<marker marker_id="2"><location camera_id="7" pinned="true" x="300" y="400"/></marker>
</markers></frame></frames>
<transform><rotation>1 0 0 0 1 0 0 0 1</rotation><translation>1 2 3</translation><scale>2</scale></transform>
<reference>LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]</reference>
<settings><property name="accuracy_markers" value="0.005"/>
<property name="accuracy_projections" value="0.25"/></settings>
</chunk>
</document>
"""
FLIGHT = """<document version="2.0.0"><chunk>
<sensors><sensor id="0" label="FC6310" type="frame"><resolution width="4864" height="3648"/>
<calibration type="frame" class="adjusted"><resolution width="4864" height="3648"/><f>3665.6</f></calibration>
</sensor></sensors>
<components><component id="0"><transform>
<rotation>0.26786212605199339 -0.96344896016433013 0.0039978225544341633 0.57498722528152235 0.15652811627789542
-0.80304958724698305 0.77307151815984154 0.217405266662895 0.59589879831836678</rotation>
<translation>-2490251.0872162799 -4297975.2206927296 3990598.5772206257</translation>
<scale>22.039365691522473</scale></transform></component></components>
<cameras><camera id="186" sensor_id="0" component_id="0" label="nadir/102MEDIA/DJI_0002.JPG">
<transform>0.0043018316431870929 -0.99965428824217073 0.025938354680913017 7.6732946732529754 -0.91501911065257591
-0.014398373341507842 -0.40315346207826114 -2.8040466887443611 0.40338755730077119 -0.021999791911691269
-0.91476471716543539 3.2954030087246085 0 0 0 1</transform>
<reference x="-120.087143111111" y="38.967084472222197" z="2084.445" sxyz="62" enabled="{enabled}"/></camera>
<camera id="699" sensor_id="0" component_id="0" label="oblique-v3/202MEDIA/DJI_0002.JPG">
<transform>-0.99328109329913516 0.10505763434178977 -0.04853414427989701 11.778405785692465 0.10412077990762875
0.62822397206434388 -0.77103404860948044 -0.42477869090217363 -0.050512700243623677 -0.77090695572825541
-0.63494167663171375 0.65453051913222349 0 0 0 1</transform></camera>
<camera id="621" sensor_id="0" component_id="0" label="oblique-v3/101MEDIA/DJI_0003.JPG">
<transform>-0.19564711060975626 -0.89057174665566485 0.41061438378207354 -3.0824954393672894 -0.88818159779628791
-0.016597186374667398 -0.45919275118459518 -9.2648364395854852 0.41575913392983538 -0.45453987444791116
-0.78774224533840365 3.8892828095878973 0 0 0 1</transform></camera></cameras>
<reference>GEOGCS["WGS 84",DATUM["World Geodetic System 1984",SPHEROID["WGS 84",6378137,298.257223563]],
PRIMEM["Greenwich",0],UNIT["degree",0.01745329251994328],AUTHORITY["EPSG","4326"]]</reference>
</chunk></document>
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "cameras.xml"
    path.write_text(text, encoding="utf-8")
    return path


def local(calibration: str = NEW, version: str = "1.4.0") -> str:
    return TEXT.format(calibration=calibration, version=version)


def formula_px(x: float, y: float) -> list[float]:
    """u, v of normalised coordinates by the manual, with the parameters of NEW and OLD."""
    q = x * x + y * y
    gain = 1 - 0.05 * q + 0.01 * q * q
    xd = x * gain + 0.001 * (q + 2 * x * x) + 2 * -0.002 * x * y
    yd = y * gain - 0.002 * (q + 2 * y * y) + 2 * 0.001 * x * y
    return [2000 + 10 + 3000 * xd + 3 * xd, 1500 - 20 + 3000 * yd]


@pytest.mark.parametrize(("calibration", "version"), [(NEW, "1.4.0"), (NEW, "2.0.0"), (OLD, "1.2.0")])
def test_a_point_falls_where_the_formula_puts_it_in_both_dialects(
    tmp_path: Path, calibration: str, version: str
) -> None:
    """Camera a.jpg looks straight down; its centre in the world is 2 (10, 20, 50) + (1, 2, 3) = (21, 42, 103)."""
    path = written(
        tmp_path, local(calibration, version).replace('enabled="true"/>\n</camera>', 'enabled="false"/></camera>')
    )
    block = assembled([read_metashape(path)])
    xyz = np.array([[31.0, 62.0, 3.0], [11.0, 22.0, -17.0]])
    xy = [formula_px(0.1, -0.2), formula_px(-10 / 120, 20 / 120)]
    assert misfit_px(block, "a.jpg", xy, xyz).max() < 1e-9
    np.testing.assert_allclose(block.exterior.position_m[block.exterior.image == 0], [[21.0, 42.0, 103.0]])


def test_a_calibration_file_is_the_camera_of_a_document_with_the_same_parameters(tmp_path: Path) -> None:
    path = tmp_path / "cam.xml"
    size = "<projection>frame</projection><width>4000</width><height>3000</height>"
    path.write_text(f"<?xml version='1.0'?>\n<calibration>\n{size}{NEW}<date>2020</date>\n</calibration>\n")
    assert recognised_file(path).format.name == "metashape"
    parts = read_metashape(path)
    document = read_metashape(written(tmp_path, local()))
    assert parts.cameras["id"] == ["cam"]
    c_px = [
        np.asarray(of.cameras["principal_distance_mm"])[0] / pixel for of, pixel in ((parts, 1e-3), (document, 4e-3))
    ]
    assert c_px[0] == pytest.approx(c_px[1], rel=1e-9)
    path.write_text(path.read_text().replace("frame", "fisheye"))
    with pytest.raises(AatriError, match=r"cam.xml:2: a camera of type 'fisheye'"):
        read_metashape(path)


def test_only_pinned_marks_are_measured_and_roles_and_accuracies_are_those_of_the_document(tmp_path: Path) -> None:
    parts = read_metashape(written(tmp_path, local()))
    assert [(i, p) for i, p in zip(parts.image_points["image"], parts.image_points["point"])] == [
        ("a.jpg", "P1"),
        ("a.jpg", "T3"),
    ]
    assert parts.image_points["sigma_px"] == 0.25
    assert any("left out: 1 place of markers not pinned" in note for note in parts.notes)
    g = parts.ground_points
    assert g["point"] == ["P1", "P2"]
    assert g["role"] == [[CONTROL] * 3, [CHECK] * 3]
    assert g["sigma_m"] == [[0.5] * 3, [0.005] * 3]
    assert parts.images["id"] == ["a.jpg", "b.jpg"]
    assert any("c.jpg" in note for note in parts.notes)


def test_a_marker_with_height_or_plan_alone_is_control_of_that(tmp_path: Path) -> None:
    text = local().replace('x="23" y="38" z="4"', 'z="4"').replace('x="1" y="2" z="3" enabled="false"', 'x="1" y="2"')
    ground = read_metashape(written(tmp_path, text)).ground_points
    assert ground["role"] == [[NO_ROLE, NO_ROLE, CONTROL], [CONTROL, CONTROL, NO_ROLE]]
    np.testing.assert_array_equal(ground["xyz_m"], [[np.nan, np.nan, 4.0], [1.0, 2.0, np.nan]])
    half = local().replace('x="21.5" y="42" z="105"', 'x="21.5" y="42"')
    with pytest.raises(AatriError, match=r"cameras.xml:\d+: the position of a.jpg lacks a coordinate"):
        read_metashape(written(tmp_path, half))


def test_images_of_one_label_are_told_apart_by_their_groups(tmp_path: Path) -> None:
    text = (
        local().replace('<group id="0">', '<group id="0" label="flight 2">').replace('label="b.jpg"', 'label="a.jpg"')
    )
    assert read_metashape(written(tmp_path, text)).images["id"] == ["a.jpg", "flight 2/a.jpg"]


def test_covariances_and_scale_bars_are_told_and_sensors_without_images_are_not_looked_at(tmp_path: Path) -> None:
    sensor = '<sensor id="5" label="fish" type="fisheye"><resolution width="9" height="9"/><calibration/></sensor>'
    matrix = "<covariance><params>f</params><coeffs>0.04</coeffs></covariance>"
    text = local().replace("</sensors>", sensor + "</sensors>").replace("</sensor>", matrix + "</sensor>", 1)
    text = text.replace('<reference x="21.5"', '<location_covariance>1</location_covariance><reference x="21.5"')
    text = text.replace("<markers>", '<scalebars><scalebar id="0" label="1_2"/></scalebars><markers>', 1)
    notes = " ".join(read_metashape(written(tmp_path, text)).notes)
    assert "covariances of 1 camera" in notes
    assert "covariances of 1 orientation" in notes
    assert "1 scale bar is not read: 1_2" in notes


def test_an_enabled_reference_is_an_observed_position_with_its_accuracy(tmp_path: Path) -> None:
    exterior = read_metashape(written(tmp_path, local())).exterior
    k = exterior["image"].index("a.jpg")
    assert exterior["position_m"][k].tolist() == [21.5, 42.0, 105.0]
    assert exterior["position_use"][k] == OBSERVED_VALUE
    np.testing.assert_allclose(np.sqrt(np.diag(exterior["position_covariance_m2"][k])), [0.02, 0.03, 0.05])


def test_a_slave_is_where_its_master_and_its_mounting_put_it(tmp_path: Path) -> None:
    """A point q of the slave's axes is R q + t in the master's: the same point of the ground from both."""
    exterior = read_metashape(written(tmp_path, local())).exterior
    k = exterior["image"].index("b.jpg")
    R = np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    q = np.array([0.3, -0.2, 4.0])  # units of the chunk, x right, y down, z forward
    in_master = R @ q + [0.5, 0.25, 0.0]
    ground = 2 * (np.diag([1, -1, -1]) @ in_master + [10, 20, 50]) + [1, 2, 3]
    seen = np.asarray(exterior["ground_from_image"][k]).T @ (ground - exterior["position_m"][k])
    np.testing.assert_allclose(seen, 2 * q * [1, -1, -1], atol=1e-12)


def test_a_rig_is_a_rig_of_the_block(tmp_path: Path) -> None:
    """The mount turns a point of the slave into the frame as R q + t does, in metres and photogrammetric axes."""
    path = written(tmp_path, local())
    block = assembled([read_metashape(path), read_metashape(path)])  # as exports of cameras and of markers both say it
    assert block.images.rig.tolist() == ["cam", "cam"]
    assert block.images.member.tolist() == ["cam", "slave"]
    assert block.images.sequence.tolist() == [1.0, 1.0]  # one exposure
    m = block.rig_members
    assert m.is_frame.tolist() == [True, False]
    assert m.position_free.tolist() == m.angle_free.tolist() == [[False] * 3, [True] * 3]
    R = np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    q = np.array([0.3, -0.2, 4.0])
    in_master = 2 * (R @ q + [0.5, 0.25, 0.0]) * [1, -1, -1]
    turned = rotation_from_angles(m.angles_rad[1]) @ (2 * q * [1, -1, -1]) + m.position_m[1]
    np.testing.assert_allclose(turned, in_master, atol=1e-12)
    (pair,) = rig_pairs(block).second.tolist()
    assert block.images.id[pair] == "b.jpg"


def test_real_poses_agree_with_gnss_and_gimbal(tmp_path: Path) -> None:
    """Pitch and roll of the gimbal to 3 degrees, and the turn between the two images of one flight; its compass is off.

    The gimbal said yaw 91.7, 6.7 and pitch 0.1, 25, 25; the receiver had no RTK, its height is barometric.
    """
    posed = read_metashape(written(tmp_path, FLIGHT.format(enabled="false")))
    said = read_metashape(written(tmp_path, FLIGHT.format(enabled="true")))
    assert posed.frame is not None
    assert posed.frame.crs == "EPSG:32610"
    apart = np.asarray(posed.exterior["position_m"])[0] - np.asarray(said.exterior["position_m"])[0]
    assert np.abs(apart[:2]).max() < 10.0
    assert abs(apart[2]) < 100.0
    roll, pitch, yaw = np.degrees(carrier_angles(np.asarray(posed.exterior["ground_from_image"]))).T
    assert np.abs(roll).max() < 3.0
    np.testing.assert_allclose(pitch, [0.1, 25.0, 25.0], atol=3.0)
    assert abs(yaw[1] - yaw[2] - (91.7 - 6.7)) < 3.0


@pytest.mark.parametrize(("yaw", "pitch", "roll"), [(30, 91, 0), (210, 89, 180)])
def test_yaw_pitch_roll_orient_an_image_that_is_not_aligned(tmp_path: Path, yaw: int, pitch: int, roll: int) -> None:
    """The matrix that Metashape's ypr2mat prints for both (agisoft.com/forum, topic 12200)."""
    told = f'z="105" yaw="{yaw}" pitch="{pitch}" roll="{roll}"'
    text = local().replace('z="105"', told)
    aligned = read_metashape(written(tmp_path, text))
    assert "yaw, pitch, roll of 1 aligned image are not read: a.jpg" in aligned.notes
    pose = "<transform>1 0 0 10 0 -1 0 20 0 0 -1 50 0 0 0 1</transform>"
    exterior = read_metashape(written(tmp_path, text.replace(pose, ""))).exterior
    assert exterior["image"] == ["a.jpg"]
    printed = [
        [0.8660254037844387, -0.008726203218641737, -0.4999238475781956],
        [-0.49999999999999994, -0.01511422733185856, -0.8658935039207541],
        [0.0, 0.9998476951563913, -0.017452406437283477],
    ]
    np.testing.assert_allclose(exterior["ground_from_image"][0], printed, rtol=0, atol=1e-12)


LOCAL_CS = 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0]'
DAMAGE = [
    (
        (
            '<group id="0"><camera id="8" sensor_id="1" master_id="7" label="b.jpg"/></group>',
            '<camera id="8" sensor_id="1" master_id="7" label="a.jpg"/>',
        ),
        r"camera a.jpg twice, first in line",
    ),
    (('marker id="2" label="T3"', 'marker id="2" label="P1"'), r"marker P1 twice"),
    (("1 0 0 10 0 -1 0 20", "1 0 0 10 0 1 0 20"), r"the transform of a.jpg is no rotation"),
    (('x="2200.5"', 'x="2200,5"'), r"x is '2200,5': a decimal comma"),
    (('x="23"', 'x="nan"'), r"x is 'nan'"),
    (('marker_id="2"', 'marker_id="5"'), r"marker 5 is not listed"),
    (("<scale>2", "<scale>-2"), r"the scale -2 is not positive"),
    (('type="frame" class="adjusted"', 'type="fisheye" class="adjusted"'), r"a camera of type 'fisheye' has no like"),
    (('sxyz="0.5"', 'sxyz="-0.5"'), r"standard deviations -0.5, -0.5, -0.5"),
    (("<f>3000</f>", "<f>-1</f>"), r"f = -1 px"),
    (("</chunk>", "</chunk><chunk><cameras><camera/></cameras></chunk>"), r"2 chunks"),
    (('LOCAL_CS["', 'PROJCS["'), r"the coordinate system .* is not understood"),
    ((LOCAL_CS, 'VERT_CS["h",VERT_DATUM["d",2005]'), r"the coordinate system .* has no horizontal part"),
]


@pytest.mark.parametrize(("change", "message"), DAMAGE)
def test_damaged_documents_are_refused_with_their_place(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert change[0] in local()
    with pytest.raises(AatriError, match=message) as refused:
        read_metashape(written(tmp_path, local().replace(*change)))
    assert "fix: " in str(refused.value)
    assert "cameras.xml:" in str(refused.value)
