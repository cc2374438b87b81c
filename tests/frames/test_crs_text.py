"""A text that names a CRS opens no file: grids by name only, no path in any of the forms PROJ reads."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from aatri.frames.checks import fault_of_frame
from aatri.frames.conversion import Frame

WKT = (
    'BOUNDCRS[SOURCECRS[GEOGCRS["a",DATUM["d",ELLIPSOID["e",6378137,298.257]],CS[ellipsoidal,2],'
    'AXIS["latitude",north],AXIS["longitude",east],UNIT["degree",0.017453292519943295]]],TARGETCRS[ID["EPSG",4326]],'
    'ABRIDGEDTRANSFORMATION["t",METHOD["NTv2",ID["EPSG",9615]],'
    'PARAMETERFILE["Latitude and longitude difference file","{}"]]]'
)


def fault(crs: str) -> str:
    found = fault_of_frame(Frame("f", ("east", "north", "up"), crs))
    return "" if found is None else found[1]


@pytest.mark.parametrize(
    "crs",
    [
        "EPSG:32650",
        "+proj=utm +zone=50 +datum=WGS84 +units=m +type=crs",
        "+init=epsg:32650",
        "WGS 84 / UTM zone 50N",
        "+proj=tmerc +lon_0=117 +k=1 +x_0=500000 +ellps=krass +units=m +type=crs",
        "urn:ogc:def:crs:EPSG::32650",
        "http://www.opengis.net/def/crs/EPSG/0/32650",
    ],
)
def test_systems_by_code_name_and_parameters_are_known(crs: str) -> None:
    assert fault(crs) == ""


@pytest.mark.parametrize(
    "form",
    [
        "+proj=utm +zone=50 +ellps=WGS84 +nadgrids={} +type=crs",
        "+proj=utm +zone=50 +ellps=WGS84 +nadgrids=@null,@{}",
        "+proj=utm +zone=50 +datum=WGS84 +geoidgrids={} +type=crs",
        "+init={}:key",
        "init={}:32650",
        "{}:key",
        "{}",
        "+proj=pipeline +step +proj=hgridshift +grids={}",
        "+proj=pipeline +step +proj=tinshift +file={}",
        "+proj=defmodel +model={}",
        WKT,
        'PROJCS["x",EXTENSION["PROJ4","+proj=utm +zone=50 +nadgrids={}"]]',
    ],
)
@pytest.mark.parametrize("path", ["/etc/passwd", "../secret.gsb", "./grid.tif", "~/grid.gsb", r"C:\grid.gsb"])
def test_no_file_is_named_by_its_path(form: str, path: str) -> None:
    assert "grids are named without a path" in fault(form.replace("{}", path))


def test_projjson_names_no_path(tmp_path: Path) -> None:
    value = {
        "type": "BoundCRS",
        "transformation": {"parameters": [{"name": "file", "value": str(tmp_path / "grid.gsb")}]},
    }
    assert "grids are named without a path" in fault(json.dumps(value))
