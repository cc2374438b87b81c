"""DJI's XMP: where a photograph looks, by closed forms; what is observed; packets in photographs and beside them."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from aatri.codes import APPROXIMATE_VALUE, OBSERVED_VALUE
from aatri.errors import AatriError
from aatri.formats.navigation.xmp import read_xmp
from aatri.formats.registry.recognised import recognised

PACKET = """<x:xmpmeta xmlns:x="adobe:ns:meta/">
 <rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
  <rdf:Description rdf:about="DJI Meta Data" xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/"
   drone-dji:AbsoluteAltitude="+88.125"
   drone-dji:GpsLatitude="+31.5"
   drone-dji:GpsLongitude="+121.25"
   drone-dji:GimbalRollDegree="+0.00" drone-dji:GimbalYawDegree="+30.00" drone-dji:GimbalPitchDegree="-60.00"
   drone-dji:RtkFlag="50" drone-dji:RtkStdLon="0.012" drone-dji:RtkStdLat="0.011" drone-dji:RtkStdHgt="0.025"
   drone-dji:GimbalReverse="0" drone-dji:GPSStatus="RTK"/>
 </rdf:RDF>
</x:xmpmeta>
"""
JPEG = b"\xff\xd8\xff\xe1\x10\x00http://ns.adobe.com/xap/1.0/\0%s\xff\xda\x00\xfe\x80"


def axes(yaw: float, pitch: float, roll: float, tmp_path: Path) -> np.ndarray:
    text = PACKET
    for key, old, new in (("Yaw", "+30.00", yaw), ("Pitch", "-60.00", pitch), ("Roll", "+0.00", roll)):
        text = text.replace(f'Gimbal{key}Degree="{old}"', f'Gimbal{key}Degree="{new}"')
    path = tmp_path / "a.JPG.xmp"
    path.write_text(text)
    return np.asarray(read_xmp(path).exterior["ground_from_image"][0])


def test_straight_down_the_upper_edge_of_the_image_is_ahead(tmp_path: Path) -> None:
    """Pitch -90, yaw 90: the camera looks down, up in the image is east, right in the image is south."""
    np.testing.assert_allclose(axes(90, -90, 0, tmp_path).T, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_a_point_ahead_is_seen_in_the_middle(tmp_path: Path) -> None:
    """Yaw 30, pitch -60: the line of sight goes north cos 30 cos 60, east sin 30 cos 60, down sin 60."""
    R = axes(30, -60, 0, tmp_path)
    sight = [math.sin(math.radians(30)) * 0.5, math.cos(math.radians(30)) * 0.5, -math.sin(math.radians(60))]
    np.testing.assert_allclose(-R[:, 2], sight, atol=1e-15)
    np.testing.assert_allclose(R[:, 0], [math.cos(math.radians(30)), -math.sin(math.radians(30)), 0], atol=1e-15)
    assert R[2, 1] == pytest.approx(0.5)  # up in the image goes upwards
    half_turned = axes(30 + 180, -120, 180, tmp_path)  # the same attitude as gimbals beyond the vertical have it
    np.testing.assert_allclose(half_turned, R, atol=1e-12)


def test_positions_are_observed_with_the_sigmas_of_rtk_alone(tmp_path: Path) -> None:
    (tmp_path / "DJI_1.JPG").write_bytes(JPEG % PACKET.encode())
    plain = PACKET.replace("RtkStd", "Other").replace("GpsLongitude", "GpsLongtitude").replace("121.25", "121.26")
    (tmp_path / "DJI_2.JPG").write_bytes(JPEG % plain.encode())
    (tmp_path / "other.JPG").write_bytes(b"\xff\xd8\xff\xda")
    (tmp_path / "DJI_3.JPG").write_bytes(JPEG % PACKET.replace('"50"', '"34"').encode())
    (found,) = recognised(tmp_path)
    assert found.format.name == "dji_xmp"
    parts = read_xmp(tmp_path)
    assert parts.images["id"] == ["DJI_1.JPG", "DJI_2.JPG", "DJI_3.JPG"]
    np.testing.assert_array_equal(parts.exterior["position_m"][0], [121.25, 31.5, 88.125])
    np.testing.assert_array_equal(parts.exterior["sigma_m"][0], [0.012, 0.011, 0.025])
    assert parts.exterior["position_use"].tolist() == [OBSERVED_VALUE, APPROXIMATE_VALUE, OBSERVED_VALUE]
    assert parts.exterior["position_m"][1, 0] == 121.26
    assert parts.notes == [
        "start values, with barometric heights: 1 position without RTK: DJI_2.JPG",
        "1 exposure without a fixed solution: DJI_3.JPG",
        "1 file has no packet of a drone: other.JPG",
    ]


def test_standard_deviations_of_no_solution_are_none(tmp_path: Path) -> None:
    keys = " ".join(f'drone-dji:RtkStd{of}="0.0"' for of in ("Lat", "Lon", "Hgt"))
    path = tmp_path / "a.xmp"
    path.write_text(
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><Description xmlns:drone-dji="d" drone-dji:GpsLatitude="+22.5" '
        f'drone-dji:GpsLongitude="114.5" drone-dji:AbsoluteAltitude="120" drone-dji:RtkFlag="0" {keys}/></x:xmpmeta>'
    )
    assert np.asarray(read_xmp(path).exterior["position_use"]).tolist() == [APPROXIMATE_VALUE]


DAMAGE = [
    (PACKET.replace('RtkStdLat="0.011"', 'RtkStdLat="0.0"'), r"a.xmp:1: RTK standard deviations"),
    (PACKET.replace("GpsLatitude", "GpsBreite"), r"a.xmp:1: the packet has no GpsLatitude"),
    (PACKET[:-40], r"a.xmp:\d+:\d+: no XML"),
    ("no packet", r"a.xmp: no XMP packet of a drone"),
]


@pytest.mark.parametrize(("text", "message"), DAMAGE)
def test_damaged_packets_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "a.xmp"
    path.write_text(text)
    with pytest.raises(AatriError, match=message) as refused:
        read_xmp(path)
    assert "fix: " in str(refused.value)


def test_an_image_with_two_packets_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.JPG").write_bytes(JPEG % PACKET.encode())
    (tmp_path / "a.xmp").write_text(PACKET)
    with pytest.raises(AatriError, match=r"the image a has a packet in a.JPG too"):
        read_xmp(tmp_path)
