"""Bad input: every fault is found with its place, the value, a remedy and exit code 3, and never a traceback."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aatri.errors import AatriError, InputError
from tests.formats.tables.block_folder import FILES, replaced, write_folder
from tests.reading import read_block

Change = dict[str, str | bytes | None]
POINTS, IMAGES, GROUND, YAML = "image_points.csv", "images.csv", "ground_points.csv", "block.yaml"


def _with_x(cell: str) -> Change:
    return replaced(POINTS, "1,a1,10.5,", f"1,a1,{cell},")


def _added(name: str, rows: str) -> Change:
    return {name: FILES[name] + rows}


BAD: dict[str, tuple[Change, str, str, str]] = {
    # case: change, place, what, remedy
    "no block.yaml": ({YAML: None}, "block.yaml", "no such file", ""),
    "no images": ({IMAGES: None}, "images.csv", "does not exist", ""),
    "no image points": ({POINTS: None}, "image_points.csv", "does not exist", ""),
    "empty file": ({IMAGES: ""}, "images.csv", "is empty", "put the data in"),
    "only comments": ({IMAGES: "# image,camera\n"}, "images.csv", "only comments", "column names"),
    "header only": ({IMAGES: "image,camera,strip\n"}, "images.csv", "no rows", "list the images"),
    "workbook": ({IMAGES: b"PK\x03\x04\x00\x00"}, "images.csv", "Excel workbook", "export it as CSV"),
    "zero byte": ({IMAGES: b"image,camera,strip\na\x001,c,s\n"}, "images.csv:2", "zero byte", "CSV"),
    "latin-1": (
        {IMAGES: "image,camera,strip\nAllg\xe4u \xfc,c,s\n".encode("latin-1")},
        "images.csv:2",
        "UTF-8",
        "UTF-8",
    ),
    "decimal comma": (_with_x('"10,5"'), "image_points.csv:2:6", "a decimal comma", "-1234.5"),
    "bare decimal comma": (_with_x("10,5"), "image_points.csv:2:1", "9 cells, but the header has 8", "decimal point"),
    "thousands": (_with_x("1_000"), "image_points.csv:2:6", "'1_000': a thousands separator", ""),
    "thousands blank": (_with_x("4 410 000"), "image_points.csv:2:6", "a thousands separator", ""),
    "full width": (_with_x("１２"), "image_points.csv:2:6", "full-width", ""),
    "unicode minus": (_with_x("\u22125"), "image_points.csv:2:6", "minus sign", ""),
    "nan": (_with_x("nan"), "image_points.csv:2:6", "not a finite number", ""),
    "inf": (_with_x("-inf"), "image_points.csv:2:6", "not a finite number", ""),
    "overflow": (_with_x("1e400"), "image_points.csv:2:6", "too large", ""),
    "excel error": (_with_x("#N/A"), "image_points.csv:2:6", "not a finite number", ""),
    "word": (_with_x("abc"), "image_points.csv:2:6", "'abc': not a number", ""),
    "empty x": (_with_x(""), "image_points.csv:2:6", "x is empty", ""),
    "short row": (_added(POINTS, "1,a1,3\n"), "image_points.csv:18:1", "3 cells", "empty cell"),
    "open quote": (_added(POINTS, '"1,a1,3,4,,,,\n'), "image_points.csv:18:1", "quote", "close it"),
    "column twice": (replaced(POINTS, "sx,sy", "sx,sx"), "image_points.csv:1:20", "'sx' twice", "remove one"),
    "unknown column": (replaced(POINTS, "group", "gruop"), "image_points.csv:1:23", "did you mean 'group'", "x_"),
    "angles of a stabilised mount": (
        replaced("exterior.csv", "use,refers_to", "mount_roll,refers_to"),
        "exterior.csv:1:40",
        "unknown column 'mount_roll'",
        "x_",
    ),
    "missing column": (replaced(IMAGES, ",camera", ",x_c"), "images.csv:2:1", "column camera missing", "header"),
    "semicolons": ({IMAGES: "image;camera;strip\n"}, "images.csv:1:1", "semicolons", "commas"),
    "image twice": (_added(IMAGES, "a1,uav,,,,,\n"), "images.csv:7:1", "'a1' twice, first in line 4", "rename"),
    "long id": (_added(IMAGES, f"{'b' * 256},uav,,,,,\n"), "images.csv:7:1", "no id", "255 bytes"),
    "unknown camera": (replaced(IMAGES, "d2,uav", "d2,uaw"), "images.csv:6:4", "did you mean 'uav'", "block.yaml"),
    "unknown image": (replaced(POINTS, "3,d2", "3,d3"), "image_points.csv:17:3", "'d3' is unknown", "images.csv"),
    "unknown fiducial": (replaced("fiducials.csv", "a1,2", "a1,9"), "fiducials.csv:3:4", "no fiducial '9'", "camera"),
    "measured twice": (_added(POINTS, "1,a1,11.5,20.25,,,,\n"), "image_points.csv:18", "measured twice", "remove"),
    "negative sigma": (replaced(POINTS, "4,4", "-4,4"), "image_points.csv:3:17", "sx is '-4'", "more than 0"),
    "zero image sigma": (replaced(POINTS, "4,4", "0,4"), "image_points.csv:3:17", "sx is '0'", "more than 0"),
    "no default sigma": (
        replaced(YAML, "image: 5, fiducial: 2, ", ""),
        "image_points.csv:2:",
        "no sigma.image",
        "add sigma: {image: 5}",
    ),
    "no control sigma": (
        replaced(YAML, "control: [2, 3, 4], ", ""),
        "ground_points.csv:4:",
        "no sigma.control",
        "0 is exact",
    ),
    "active": (replaced(POINTS, ",no\n", ",nein\n"), "image_points.csv:10:", "active is 'nein'", "yes or no"),
    "ground twice": (_added(GROUND, "K,1,2,3,1,1,1,,,\n"), "ground_points.csv:7:1", "'K' twice, first in line 2", ""),
    "negative ground sigma": (
        replaced(GROUND, "7.378,1", "7.378,-1"),
        "ground_points.csv:3:",
        "sX is '-1'",
        "0 (exact)",
    ),
    "indefinite": (replaced(GROUND, "1,2,3,0.5", "1,2,3,2.5"), "ground_points.csv:3:", "negative eigenvalue", "not"),
    "role": (
        replaced(GROUND, "approximate", "aproximate"),
        "ground_points.csv:6:",
        "did you mean 'approximate'",
        "XY:",
    ),
    "role axes": (replaced(GROUND, "XY:control", "XZ:control"), "ground_points.csv:3:", "once each", "XY:"),
    "exterior image": (replaced("exterior.csv", "a2,45", "a9,45"), "exterior.csv:3:1", "'a9' is unknown", "images.csv"),
    "use": (replaced("exterior.csv", "observed", "obsrved"), "exterior.csv:5:", "did you mean 'observed'", "one of"),
    "rotation missing": (
        replaced(YAML, "rotation: phi-omega-kappa\n", ""),
        "block.yaml:1:1",
        "rotation is missing",
        "add",
    ),
    "angle unit missing": (replaced(YAML, "angle: gon, ", ""), "block.yaml:6:8", "units.angle is missing", "deg"),
    "geodetic type": (
        replaced("geodetic.csv", "angle,", "angel,"),
        "geodetic.csv:3:1",
        "did you mean 'angle'",
        "one of",
    ),
    "geodetic station": (
        replaced("geodetic.csv", "distance,1,2", "distance,1,77"),
        "geodetic.csv:2:12",
        "'77'",
        "add it",
    ),
    "geodetic set": (replaced("geodetic.csv", ",s1,", ",,"), "geodetic.csv:4:", "a direction needs `set`", "name"),
    "geodetic number": (replaced("geodetic.csv", "141.42", "141,42"), "geodetic.csv:2:", "cells", "decimal point"),
    "length no number": (
        replaced("geodetic.csv", "141.42", "far"),
        "geodetic.csv:2:14",
        "'far', not a number",
        "ground",
    ),
    "angle no number": (replaced("geodetic.csv", "100.5", "wide"), "geodetic.csv:3:11", "'wide', not a number", "gon"),
    "covariance row": (replaced("covariances.csv", "4,5", "4,9"), "covariances.csv:2:12", "rows 1 to 7", "from 1"),
    "covariance size": (
        replaced("covariances.csv", "1e-6", "1e-3"),
        "geodetic.csv:6",
        "dX K 1, dY K 1 is not positive definite",
        "smaller",
    ),
    "relative type": (
        replaced("relative_control.yaml", "sphere", "shpere"),
        "relative_control.yaml:6:10",
        "did you mean",
        "types are",
    ),
    "relative point": (
        replaced("relative_control.yaml", "[K, 0123]", "[K, 0124]"),
        "relative_control.yaml:2:",
        "'0124'",
        "mend",
    ),
    "relative sigma": (
        replaced("relative_control.yaml", ", sigma: 0.0002", ""),
        "relative_control.yaml:2:",
        "either",
        "constraint",
    ),
    "yaml key": (
        replaced(YAML, "principal_distance: 24", "focal_length: 24"),
        "block.yaml:25:5",
        "focal_length",
        "keys are",
    ),
    "yaml value": (
        replaced(YAML, "kind: digital", "kind: digtal"),
        "block.yaml:21:11",
        "did you mean 'digital'",
        "film",
    ),
    "yaml number": (replaced(YAML, "24.01", "-24.01"), "block.yaml:25:25", "-24.01", "greater than 0"),
    "yaml list": (replaced(YAML, "format: [6000, 4000]", "format: [6000]"), "block.yaml:24:13", "format", "2 items"),
    "yaml axes": (replaced(YAML, "north, east", "south, east"), "block.yaml:4:8", "axes must be", ""),
    "yaml twice": (replaced(YAML, "terrain_height: 6.1", "rotation: phi-omega-kappa"), "block.yaml:9:1", "twice", ""),
    "yaml tab": (replaced(YAML, "  map:", "\tmap:"), "block.yaml:4:1", "tab", "spaces"),
    "yaml distortion": (replaced(YAML, "p1: 1e-6", "p9: 1e-6"), "block.yaml:26:", "p9", ""),
    "yaml model is a list": (
        replaced(YAML, "model: brown", "model: [brown]"),
        "block.yaml:26:",
        "is a list or mapping",
        "brown",
    ),
    "yaml sigmas": (replaced(YAML, "k1: 1e-7", "k7: 1e-7"), "block.yaml:27:", "k7", ""),
    "yaml sigmas of a vector": (
        replaced(YAML, "[0.01, 0.01]", "[0.0,1, 0.01]"),
        "block.yaml:27:",
        "takes 2 values",
        "",
    ),
    "pixel origin": (replaced(YAML, ", origin: top-left-corner", ""), "block.yaml:", "origin", ""),
}


@pytest.mark.parametrize("case", BAD)
def test_a_fault_is_told_with_place_remedy_and_exit_code(tmp_path: Path, case: str) -> None:
    changes, place, what, remedy = BAD[case]
    folder = write_folder(tmp_path / "block", changes)
    with pytest.raises(AatriError) as caught:
        read_block(folder)
    message = str(caught.value)
    assert caught.value.exit_code == 3
    assert str(folder / place) in message
    assert what in message
    assert "fix: " in message
    assert remedy in message


def test_all_faults_come_at_once(tmp_path: Path) -> None:
    changes = {**_with_x("abc"), **replaced(GROUND, "approximate", "aproximate"), **replaced(IMAGES, "d2,uav", "d2,xx")}
    with pytest.raises(AatriError) as caught:
        read_block(write_folder(tmp_path / "block", changes))
    for place in ("image_points.csv:2:6", "ground_points.csv:6:", "images.csv:6:4"):
        assert place in str(caught.value)


def test_a_missing_folder_names_the_nearest_one(tmp_path: Path) -> None:
    write_folder(tmp_path / "rc30_block")
    with pytest.raises(InputError, match="did you mean 'rc30_block'"):
        read_block(tmp_path / "rc30_blok")
    with pytest.raises(InputError, match="is a file"):
        read_block(tmp_path / "rc30_block" / "block.yaml")


def test_many_faults_of_one_kind_are_counted(tmp_path: Path) -> None:
    rows = "".join(f"p{k},a1,x{k},1,,,,\n" for k in range(300))
    with pytest.raises(AatriError) as caught:
        read_block(write_folder(tmp_path / "block", _added(POINTS, rows)))
    assert "280 more cells" in str(caught.value)
    assert len(str(caught.value).splitlines()) < 60


def test_points_seen_once_and_images_without_points_are_set_aside_however_many(tmp_path: Path) -> None:
    rows = "".join(f"once{k},a1,{k},1,,,,\n" for k in range(30))
    changes = {**_added(POINTS, rows), **_added(IMAGES, "z9,uav,,,,,\n")}
    rejects = read_block(write_folder(tmp_path / "block", changes)).rejects
    assert (rejects.reason == "seen in one image only").sum() == 30
    assert rejects.id[rejects.kind == "image"].tolist() == ["z9"]


def test_a_wrong_unit_of_image_coordinates_is_an_error(tmp_path: Path) -> None:
    changes = replaced(YAML, "format: [6000, 4000]", "format: [20, 13]")
    with pytest.raises(InputError, match=r"outside the image format; at most 5%"):
        read_block(write_folder(tmp_path / "block", changes))


def test_another_frame_needs_pyproj_or_a_crs(tmp_path: Path) -> None:
    yaml = (
        FILES[YAML]
        .replace("frames:\n", "frames:\n")
        .replace("crs: EPSG:32650}\n", "crs: EPSG:32650}\n  wgs: {axes: [latitude, longitude, height]}\n")
    )
    ground = FILES[GROUND].replace("datum\n", "datum,frame\n").replace("\n", ",\n").replace("frame,\n", "frame\n")
    ground += "far,40.5,116.5,100,1,1,1,,check,,wgs\n"
    with pytest.raises(InputError, match=r"aatri\[crs\]|local"):
        read_block(write_folder(tmp_path / "block", {YAML: yaml, GROUND: ground}))


_mutations = st.tuples(st.sampled_from(sorted(FILES)), st.integers(0, 10_000), st.integers(0, 6), st.binary(max_size=6))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(mutations=st.lists(_mutations, min_size=1, max_size=3))
def test_mutated_files_give_a_block_or_an_error_of_ours(tmp_path: Path, mutations: list[Any]) -> None:
    changes: Change = {}
    for name, place, length, new in mutations:
        text = FILES[name].encode()
        k = place % len(text)
        changes[name] = text[:k] + new + text[k + length :]
    exit_code = 0
    try:
        read_block(write_folder(tmp_path / "block", changes))
    except AatriError as error:
        exit_code = error.exit_code
    assert exit_code in (0, 3)
