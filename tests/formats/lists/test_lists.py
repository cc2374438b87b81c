"""Lists by their columns: a known point falls where the convention says; headers of programs; what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.codes import CHECK, CONTROL, NO_ROLE, OBSERVED_VALUE
from aatri.errors import AatriError
from aatri.formats.lists.list_columns import PRESETS
from aatri.formats.lists.list_reader import read_list
from aatri.formats.parts.format import Reading
from aatri.formats.registry.recognised import recognised, recognised_file
from aatri.formats.registry.sources import read_source
from aatri.progress import SILENT

PLACE = "400.0 -200.0 1500.0"
C = 100.0

# A camera at PLACE is turned by 90 degrees about one axis after the other; the point 1000 m below and 100 m east of it
# is seen by hand: straight down (x right = east, y up = north) at x = +10 mm for c = 100 mm.
SEEN = {
    "omega-phi-kappa 0 0 0": (10.0, 0.0),
    "omega-phi-kappa 0 0 90": (0.0, -10.0),  # image x to the north: east is at -y
    "phi-omega-kappa 0 0 -90": (0.0, 10.0),
    "yaw-pitch-roll 0 0 0": (10.0, 0.0),  # upper edge to the north
    "yaw-pitch-roll 90 0 0": (0.0, 10.0),  # upper edge to the east
}


def image_of(R: np.ndarray, position: list[float]) -> np.ndarray:
    """x, y in mm by the collinearity equations, of the point 100 m east of a place and 1000 m below."""
    u = R.T @ (np.array([500.0, -200.0, 500.0]) - position)
    return -C * u[:2] / u[2]


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "list.txt"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("case", SEEN)
def test_a_point_falls_where_the_angles_say(tmp_path: Path, case: str) -> None:
    system, *angles = case.split()
    names = system.replace("-", " ")
    parts = read_list(written(tmp_path, f"image X Y Z {names}\na.jpg {PLACE} {' '.join(angles)}\n"), Reading())
    R = np.asarray(parts.exterior["ground_from_image"])[0]
    np.testing.assert_allclose(image_of(R, [400.0, -200.0, 1500.0]), SEEN[case], atol=1e-12)


def test_a_forward_tilt_by_pitch_and_by_phi_omega(tmp_path: Path) -> None:
    """Pitch up by 45 degrees looks ahead, to the north; omega about east by 45 degrees does the same."""
    pitched = read_list(written(tmp_path, f"image X Y Z yaw pitch roll\na.jpg {PLACE} 0 45 0\n"), Reading())
    turned = read_list(written(tmp_path, f"image X Y Z omega phi kappa\na.jpg {PLACE} 45 0 0\n"), Reading())
    for parts in (pitched, turned):
        axis = np.asarray(parts.exterior["ground_from_image"])[0] @ [0.0, 0.0, -1.0]
        np.testing.assert_allclose(axis, [0.0, np.sqrt(0.5), -np.sqrt(0.5)], atol=1e-12)


@pytest.mark.parametrize(("sign", "axis"), [("", -1.0), ("-", 1.0)])
def test_phi_of_the_other_system_turns_the_other_way_and_a_sign_turns_it_back(
    tmp_path: Path, sign: str, axis: float
) -> None:
    """R = Ry(-phi): with phi = 90 the camera, looking down, looks to the east; with `-phi` to the west."""
    said = Reading(columns=f"image X Y Z {sign}phi omega kappa", rotation="phi-omega-kappa")
    parts = read_list(written(tmp_path, f"a.jpg {PLACE} 90 0 0\n"), said)
    R = np.asarray(parts.exterior["ground_from_image"])[0]
    np.testing.assert_allclose(R @ [0.0, 0.0, -1.0], [-axis, 0.0, 0.0], atol=1e-12)


HEADERS = {
    "metashape": "# Cameras (1)\n# PhotoID, X, Y, Z, Omega, Phi, Kappa, r11, r12, r13, r21, r22, r23, r31, r32, r33\n"
    "a.jpg\t400.0\t-200.0\t1500.0\t0\t0\t90\t0\t-1\t0\t1\t0\t0\t0\t0\t1\n",
    "pix4d": f"imageName X Y Z Omega Phi Kappa\na.jpg {PLACE} 0 0 90\n",
    "metashape reference": "# CoordinateSystem: EPSG:32632\n#Label,X/Easting,Y/Northing,Z/Altitude,Yaw,Pitch,Roll\n"
    "a.jpg,400.0,-200.0,1500.0,270,0,0\n",
    "pix4d errors": "imageName, cameraIndex, cameraName, X_opt, Y_opt, Z_opt, X_gps, Y_gps, Z_gps, omega, phi, kappa\n"
    "a.jpg, 0, FC, 400.1, -200.1, 1500.1, 400.0, -200.0, 1500.0, 0, 0, 90\n",
    "italian": "foto;omega;phi;kappa;est;nord;quota\na.jpg;0;0;90;400.0;-200.0;1500.0\n",
    "gon": "Photo;Omega [gon];Phi [gon];Kappa [gon];Northing;Easting;Height\na.jpg;0;0;100;-200.0;400.0;1500.0\n",
    "applanix": "POSPac\nBoresight 0.01\n(position in Meters, orientation in Degrees, lat, long in Deg)\n"
    "ID EVENT TIME(s) EASTING NORTHING ELLIPSOID HEIGHT OMEGA PHI KAPPA LAT LONG\n"
    "a.jpg 1 200.5 400.0 -200.0 1500.0 0 0 90 36.0 117.0\n",
    "applanix without ID": "(position in Meters, orientation in Radians)\n"
    f"EVENT,TIME(s),EASTING,NORTHING,HEIGHT,OMEGA,PHI,KAPPA\na.jpg,200.5,400.0,-200.0,1500.0,0,0,{np.pi / 2!r}\n",
}


@pytest.mark.parametrize("kind", HEADERS)
def test_a_header_tells_the_columns_whatever_their_order(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path, HEADERS[kind])
    parts = read_source(path, Reading(), SILENT)
    assert parts.format == "table"
    assert parts.images["id"] == ["a.jpg"]
    R, position = np.asarray(parts.exterior["ground_from_image"])[0], np.asarray(parts.exterior["position_m"])[0]
    assert position.tolist() == [400.0, -200.0, 1500.0]
    np.testing.assert_allclose(image_of(R, position), (0.0, -10.0), atol=1e-12)
    assert any(note.startswith("columns read as") for note in parts.notes)
    assert any("image = a.jpg" in note for note in parts.notes)  # a row as read


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("sign", [" ", "\t", ", "])
def test_an_applanix_list_is_recognised_and_observed_whatever_its_line_ends_and_separators(
    tmp_path: Path, end: str, sign: str
) -> None:
    """With line ends of old Macs it was a list of start values."""
    preamble, header, row = HEADERS["applanix"].rsplit("\n", 3)[:3]
    names = header.replace("ELLIPSOID HEIGHT", "ELLIPSOID_HEIGHT").split()
    header = ", ".join(names).replace("ELLIPSOID_HEIGHT", "ELLIPSOID HEIGHT") if sign != "\t" else "\t".join(names)
    path = tmp_path / "eo.txt"
    path.write_bytes(end.join([preamble.replace("\n", end), header, sign.join(row.split()), ""]).encode())
    (seen,) = recognised(path)
    assert seen.format.name == "applanix"
    parts = read_source(path, Reading(format="applanix"), SILENT)
    assert parts.exterior["position_use"] == OBSERVED_VALUE
    assert parts.exterior["position_m"].tolist() == [[400.0, -200.0, 1500.0]]
    assert "columns that are not read: EVENT, LAT, LONG; `columns` says what they are" in parts.notes


@pytest.mark.parametrize(
    ("below", "kappa"),
    [
        ("---- --- --- === --- --- --- --- --- --- ---", 90),
        ("- - (s) (m) [m] m (deg) deg deg deg deg", 90),
        ("- - s m m m gon gon gon - -", 100),
    ],
)
def test_a_rule_and_a_row_of_units_below_a_header_are_no_rows(tmp_path: Path, below: str, kappa: int) -> None:
    text = HEADERS["applanix"].replace("(position in Meters, orientation in Degrees, lat, long in Deg)\n", "")
    text = text.replace("a.jpg", f"\n{below}\n\na.jpg").replace(" 90 36", f" {kappa} 36")
    parts = read_source(written(tmp_path, text), Reading(), SILENT)
    assert parts.images["id"] == ["a.jpg"]
    R, position = np.asarray(parts.exterior["ground_from_image"])[0], np.asarray(parts.exterior["position_m"])[0]
    np.testing.assert_allclose(image_of(R, position), (0.0, -10.0), atol=1e-12)
    assert any("not read, before the first row" in note and below in note for note in parts.notes)


def test_measured_control_of_pix4d_is_read_and_what_it_computes_is_not(tmp_path: Path) -> None:
    names = [f"GCP {kind} {axis}" for kind in ("measured", "computed") for axis in "XYZ"]
    path = written(tmp_path, f"GCP label, {', '.join(names)}\ng1, 1.5, 2.5, 3.5, 1.6, 2.6, 3.6\n")
    points = read_source(path, Reading(), SILENT).ground_points
    assert points["point"] == ["g1"]
    assert np.asarray(points["xyz_m"]).tolist() == [[1.5, 2.5, 3.5]]


def test_a_row_of_other_units_is_refused(tmp_path: Path) -> None:
    for units, message in (("- px px m", r"list.txt:2: X in px"), ("- ft ft ft", r"list.txt:2: X in ft")):
        path = written(tmp_path, f"point X Y Z\n{units}\nP 1 2 3\n")
        with pytest.raises(AatriError, match=message):
            read_source(path, Reading(), SILENT)


@pytest.mark.parametrize("above", ["", "# made by X\n# 2 images\n", "Lambert 93\nIGN69\n", "#"])
def test_orientations_of_ign_are_recognised_below_comments_and_headings(tmp_path: Path, above: str) -> None:
    path = written(tmp_path, f"{above}NOM\tX\tY\tZ\tO\tP\tK\tCAMERA\na.jpg\t400.0\t-200.0\t1500.0\t0\t0\t90\tcam\n")
    (seen,) = recognised(path)
    assert seen.format.name == "ign_opk"
    parts = read_source(path, Reading(format="ign_opk"), SILENT)
    assert parts.exterior["position_m"].tolist() == [[400.0, -200.0, 1500.0]]
    assert not any("NOM" in note for note in parts.notes)


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_reads_a_list_without_a_header(tmp_path: Path, name: str) -> None:
    words = {"image": "a.jpg", "-": "7", "X": "400.0", "Y": "-200.0", "Z": "1500.0", "time": "3", "kappa": "90"}
    matrix = dict(
        zip([f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)], ["0", "-1", "0", "1", "0", "0", "0", "0", "1"])
    )
    columns = PRESETS[name].columns
    row = [(words | matrix).get(column, "0") for column in columns.names]
    path = written(tmp_path, (PRESETS[name].separator or " ").join(row) + "\n")
    parts = read_source(path, Reading(columns=name, format="table"), SILENT)
    np.testing.assert_allclose(
        image_of(np.asarray(parts.exterior["ground_from_image"])[0], [400.0, -200.0, 1500.0]), (0.0, -10.0), atol=1e-12
    )


def test_lists_of_control_of_positions_and_of_image_points(tmp_path: Path) -> None:
    control = "Name,E,N,H,sE,sN,sH,role\nP1,1,2,3,0.01,0.02,0.03,control\nP2,4,5,6,0.1,0.1,0.1,check\nP3,7,8,,1,1,1,\n"
    parts = read_source(written(tmp_path, control), Reading(), SILENT)
    assert parts.ground_points["role"].tolist() == [[CONTROL] * 3, [CHECK] * 3, [NO_ROLE] * 3]
    assert parts.ground_points["sigma_m"][0].tolist() == [0.01, 0.02, 0.03]
    positions = "filename;lat;lon;alt;hacc;vacc\na.jpg;45.0;9.0;300;0.02;0.04\n"
    parts = read_source(written(tmp_path, positions), Reading(), SILENT)
    assert parts.exterior["position_m"].tolist() == [[9.0, 45.0, 300.0]]
    assert parts.exterior["sigma_m"].tolist() == [[0.02, 0.02, 0.04]]
    assert parts.exterior["position_use"].tolist() == [1]
    assert parts.frame is not None
    assert parts.frame.axes == ("longitude", "latitude", "height")
    measured = "image,point,x,y\na.jpg,P1,10.5,20.25\n"
    parts = read_source(written(tmp_path, measured), Reading(), SILENT)
    assert parts.image_points["xy"].tolist() == [[10.5, 20.25]]
    both = "point image x y X Y Z\nP1 a.jpg 1 2 10 20 30\nP1 b.jpg 3 4 10 20 30\n"
    parts = read_source(written(tmp_path, both), Reading(), SILENT)
    assert parts.ground_points["point"] == ["P1"]
    assert len(parts.image_points["xy"]) == 2


SURVEYED = {
    "Foto-Nr;Rechtswert [m];Hochwert [m];Höhe [m];Omega [gon];Phi [gon];Kappa [gon]\n1;2;3;4;5;6;7\n":
        "image X Y Z omega phi kappa",
    "Point ID,Northing (m),Easting (m),Elev. (m),Std. Dev. E,Std. Dev. N,Std. Dev. H,Code\nA,1,2,3,.1,.1,.1,full\n":
        "point Y X Z sX sY sZ role",
    "Punkt,Rechts,Hoch,Höhe,Code\nA,1,2,3,77\n": "point X Y Z -",
    "marker_name,lat,lon,alt,h_acc,v_acc\nA,45,9,3,.1,.1\n": "point latitude longitude Z sXY sZ",
    "filename,GPSLatitude,GPSLongitude,GPSAltitude,GPSYaw,GPSPitch,GPSRoll\na,45,9,3,1,2,3\n":
        "image latitude longitude Z yaw pitch roll",
    "Name,East,North,Up,sigma_e,sigma_n,sigma_u\nA,1,2,3,.1,.1,.1\n": "point X Y Z sX sY sZ",
    "photo,pt,u,v\na.jpg,A,1,2\n": "image point x y",
    "imageName,latitude,longitude,altitude,accHor,accVer\na.jpg,45,9,3,.1,.2\n": "image latitude longitude Z sXY sZ",
    'ID  TIME (s)  EASTING  NORTHING  ELLIPSOID HEIGHT (m)\n"IMG 1.jpg"  5  1  2  3\n': "image time X Y Z",
}  # fmt: skip


@pytest.mark.parametrize("text", SURVEYED)
def test_headers_of_surveyors_and_of_cameras_are_understood(tmp_path: Path, text: str) -> None:
    """Names in other words and languages, numbers, accents, `gps` before them; a code is a role if it says one."""
    parts = read_source(written(tmp_path, text), Reading(), SILENT)
    read = next(note for note in parts.notes if note.startswith("columns read as"))
    assert read.removeprefix("columns read as ").split(", ")[0] == SURVEYED[text]
    unread = [note for note in parts.notes if note.startswith("columns that are not read: ")]
    assert len(unread) == ("-" in SURVEYED[text].split())


def test_what_stands_above_the_header_is_told_and_the_header_is_not(tmp_path: Path) -> None:
    parts = read_source(written(tmp_path, "a report\npoint,X,Y,Z\nA,1,2,3\n"), Reading(), SILENT)
    assert [note for note in parts.notes if note.startswith("not read")] == ["not read, before the first row: a report"]


def test_columns_that_are_said_make_a_list_of_a_file_without_a_header(tmp_path: Path) -> None:
    path = written(tmp_path, "1 a.jpg 400.0 -200.0 1500.0 0 0 90\n")
    assert read_source(path, Reading(columns="erdas"), SILENT).images["id"] == ["a.jpg"]


def test_standard_deviations_of_another_system_turn_with_the_axes(tmp_path: Path) -> None:
    """Yaw 90: roll is then about the east-west axis of flight, so that its uncertainty is that of omega."""
    text = f"image X Y Z yaw pitch roll syaw spitch sroll\na.jpg {PLACE} 90 0 0 3 2 1\n"
    parts = read_list(written(tmp_path, text), Reading())
    np.testing.assert_allclose(np.degrees(parts.exterior["angle_sigma_rad"]), [[1.0, 2.0, 3.0]], atol=1e-12)
    assert parts.exterior["angle_use"].tolist() == [1]


OPK = f"imageName X Y Z Omega Phi Kappa\na.jpg {PLACE} 10 20 90\nb.jpg {PLACE} 0 0 0\n"
MATRIX = HEADERS["metashape"].replace("90\t0\t-1\t0\t1", "90\t1\t0\t0\t0")
DAMAGE = [
    (OPK.replace("b.jpg", "a.jpg"), r":3: image a.jpg twice, first in line 2"),
    (OPK.replace("-200.0", "-200,0", 1), r":2: '-200,0': a decimal comma"),
    (OPK.replace(" 20 ", " x "), r":2: 'x'"),
    (OPK.replace("b.jpg", "b 2.jpg"), r"a name with blanks stands in double quotes"),
    (OPK.replace(" 10 20", " 10"), r":2: 6 words, for the columns image X Y Z"),
    (MATRIX, r":3: r11 ... r33 is neither the matrix of the angles nor its transpose"),
    ("point X Y Z role\nP 1 2 3 maybe\n", r":2: role 'maybe'"),
    ("point X Y Z sX sY sZ\nP 1 2 3 0.1 -0.1 0.1\n", r":2: standard deviations"),
    ("point X Y Z\nP 1 2 3\nP 1 2 4\n", r":3: point P twice, first in line 2"),
    ("image point x y\na P 1 \n", r":2: 3 words"),
    ("image lat lon\na 120 10\n", r":2: latitude 120"),
    ("<html><body>404</body></html>", r"this is a web page"),
    ("(position in Feet, orientation in Degrees)\n" + OPK, r":1: positions in Feet"),
    ("a 1 2 3\n", r":1: its first line is 'a 1 2 3', and no header tells its columns"),
    ("", r"the file is empty"),
]


@pytest.mark.parametrize(("text", "message"), DAMAGE)
def test_damaged_lists_are_refused_with_their_place(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(AatriError, match=message) as refused:
        read_list(written(tmp_path, text), Reading())
    assert "fix: " in str(refused.value)


def test_the_transpose_of_the_matrix_is_taken_too_and_the_angles_count(tmp_path: Path) -> None:
    turned = HEADERS["metashape"].replace("\t0\t-1\t0\t1\t0\t0\t", "\t0\t1\t0\t-1\t0\t0\t")
    R = np.asarray(read_list(written(tmp_path, turned), Reading()).exterior["ground_from_image"])[0]
    np.testing.assert_allclose(R, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


@pytest.mark.parametrize(
    ("columns", "message"),
    [("image X Y Q", "'Q' is no column"), ("X Y Z", "neither `image` nor `point`"), ("image X X Y", "X twice")],
)
def test_columns_that_are_none_are_refused(tmp_path: Path, columns: str, message: str) -> None:
    with pytest.raises(AatriError, match=message):
        read_list(written(tmp_path, OPK), Reading(columns=columns))


def test_a_list_without_a_header_is_not_recognised_and_the_message_says_what_to_say(tmp_path: Path) -> None:
    with pytest.raises(AatriError, match=r"list.txt:columns=point X Y Z"):
        recognised_file(written(tmp_path, "a.jpg 1 2 3\n"))
