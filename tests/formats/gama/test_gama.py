"""A small network of gama-local, and the same with one thing wrong: numbers, encodings, entities, covariances."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aatri.artifacts.block import Block
from aatri.cli.main import app
from aatri.errors import AatriError
from tests.reading import read_block, read_gama
from tests.stages.hand_block import Heard

NETWORK = """<?xml version="1.0" encoding="utf-8"?>
<gama-local xmlns="http://www.gnu.org/software/gama/gama-local">
<network axes-xy="ne" angles="left-handed">
<parameters sigma-apr="1" />
<points-observations distance-stdev="3 2 0.5" direction-stdev="10">
<point id="A" x="1000" y="5000" fix="xy" />
<point id="B" x="1100.25" y="5000" fix="xy" />
<point id="P" adj="xy" />
<obs from="A">
  <direction to="B" val="0" />
  <direction to="P" val="45-00-59.5" stdev="2" />
  <distance to="P" val="100.000" />
</obs>
<obs from="B">
  <distance to="P" val="1000" stdev="5" />
  <angle bs="A" fs="P" val="350.5" stdev="10" />
  <cov-mat dim="2" band="1"> 25 10 100 </cov-mat>
</obs>
</points-observations>
</network>
</gama-local>
"""


def read(folder: Path, text: str | bytes = NETWORK) -> Block:
    path = folder / "network.gkf"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_gama(path)


def sigma_of(block: Block, line: int) -> float:
    return float(block.geodetic.sigma[block.geodetic.line == line][0])


def test_standard_deviations_are_own_by_type_and_of_a_covariance_matrix(tmp_path: Path) -> None:
    block = read(tmp_path)
    assert sigma_of(block, 12) == pytest.approx((3 + 2 * math.sqrt(0.1)) * 1e-3)  # a + b D^c, D = 0.1 km
    assert sigma_of(block, 10) == pytest.approx(10 * 1e-4 * math.pi / 200)
    assert sigma_of(block, 11) == pytest.approx(math.radians(2 / 3600))
    assert sigma_of(block, 15) == pytest.approx(5e-3)
    assert block.geodetic_covariances.value[0] == pytest.approx(10 * 1e-3 * 1e-4 * math.pi / 200)
    direction = block.geodetic.value[block.geodetic.line == 11][0]
    assert direction == pytest.approx(math.radians(45 + 59.5 / 3600))


def test_seconds_may_be_rounded_up_to_sixty(tmp_path: Path) -> None:
    block = read(tmp_path, NETWORK.replace("45-00-59.5", "45-00-60.00"))
    assert block.geodetic.value[block.geodetic.line == 11][0] == pytest.approx(math.radians(45 + 1 / 60))


def test_a_negative_exponent_makes_no_degrees(tmp_path: Path) -> None:
    block = read(tmp_path, NETWORK.replace('val="350.5"', 'val="7e-5"'))
    assert block.geodetic.value[block.geodetic.line == 16][0] == pytest.approx(7e-5 * math.pi / 200)


@pytest.mark.parametrize(
    ("old", "new", "line", "what"),
    [
        ("1100.25", "12_043.305", 7, "thousands"),
        ("1100.25", "١١٠٠", 7, "not ASCII"),
        ("1100.25", "1100,25", 7, "comma"),
        ("1100.25", "1e999", 7, "too large"),
        ("1100.25", "nan", 7, "not a finite"),
        ("1100.25", "0x1F", 7, "not a number"),
        ("45-00-59.5", "87-", 11, "not an angle"),
        ("45-00-59.5", "45-61-00", 11, "not an angle"),
        ("45-00-59.5", "4_5-00-59.5", 11, "not an angle"),
        ("45-00-59.5", "45-00-5٩", 11, "not an angle"),
        ('"3 2 0.5"', '"3 mm"', 5, "'mm'"),
        ('"3 2 0.5"', '"1 2 3 4"', 5, "4 numbers"),
        ('"10"', '"10 1"', 5, "2 numbers"),
        ('"3 2 0.5"', '"3 2 1e9"', 12, "no number"),
        ('stdev="2"', 'stdev="-2"', 11, "impossible stdev"),
        ('stdev="2"', 'stdev="1e60"', 11, "not the standard deviation of a measurement"),
        ('dim="2"', 'dim="1e99"', 17, "whole number"),
        ('dim="2"', 'dim="9999999999"', 17, "dimension"),
        ("25 10 100", "25 50 100", 16, "not positive definite"),
        ("25 10 100", "-25 10 100", 17, "the variance -25"),
        ("25 10 100", "25 1٠ 100", 17, "not ASCII"),
        ('"P"', f'"{"P" * 256}"', 8, "no id"),
        ('"P"', '"P&#x85;"', 8, "no id"),
        ('id="B"', 'id="A"', 7, "twice"),
        ("utf-8", "klingon-1", 1, "not known"),
        ("utf-8", "base64", 1, "not known"),
        ("utf-8", "ascii", 2, "not ascii"),
        ("<gama-local ", '<!DOCTYPE gama-local [<!ENTITY e "5">]><gama-local ', 2, "entity"),
        ("1100.25", "11&nix;00", 7, "entity"),
        ('<obs from="A">', '<coordinates><point id="E" x="1" y="2"/></coordinates><obs from="A">', 9, "no cov-mat"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path: Path, old: str, new: str, line: int, what: str) -> None:
    text = NETWORK.replace(old, new)
    if new == "ascii":
        text = text.replace("<gama-local ", "<!-- Größe --><gama-local ")
    if new.startswith("11&"):
        text = text.replace("<gama-local ", '<!DOCTYPE gama-local SYSTEM "gama-local.dtd"><gama-local ')
    if new == '"3 2 1e9"':
        text, what = text.replace('val="100.000"', 'val="1e6"'), "impossible stdev"
    with pytest.raises(AatriError, match=what) as caught:
        read(tmp_path, text)
    assert caught.value.exit_code == 3
    assert f"network.gkf:{line}" in str(caught.value)


@pytest.mark.parametrize("encoding", ["iso-8859-2", "windows-1250", "gbk", "utf-16", "utf-8-sig"])
def test_an_encoding_is_read_as_it_is_declared(tmp_path: Path, encoding: str) -> None:
    name = "点" if encoding == "gbk" else "Ú"
    declared = NETWORK.replace("utf-8", encoding.removesuffix("-sig")).replace('id="P"', f'id="{name}"')
    block = read(
        tmp_path, declared.replace('to="P"', f'to="{name}"').replace('fs="P"', f'fs="{name}"').encode(encoding)
    )
    assert name in block.points.id


def test_a_distance_of_nothing_is_set_aside_by_name(tmp_path: Path) -> None:
    block = read(tmp_path, NETWORK.replace('val="100.000"', 'val="0"'))
    assert block.rejects.id.tolist() == ["horizontal_distance A P"]
    assert block.geodetic.active.sum() == 4


def test_a_levelled_section_has_the_standard_deviation_of_its_length(tmp_path: Path) -> None:
    """sigma-apr, mm, times the root of the length in km; a stdev of its own goes before."""
    levelled = """<height-differences>
  <dh from="A" to="P" val="1.5" dist="4" />
  <dh from="B" to="P" val="1.5" dist="4" stdev="3" extern="section 7" />
</height-differences>
</points-observations>"""
    text = NETWORK.replace('sigma-apr="1"', 'sigma-apr="2"').replace("</points-observations>", levelled)
    block = read(tmp_path, text)
    sigma = block.geodetic.sigma[block.geodetic.type == "height_difference"]
    assert sorted(sigma.tolist()) == pytest.approx([0.003, 0.004])


def test_observations_to_points_that_are_not_listed_are_told_and_kept(tmp_path: Path) -> None:
    path, heard = tmp_path / "network.gkf", Heard()
    path.write_text(NETWORK.replace('<point id="P" adj="xy" />', ""))
    block = read_gama(path, reporter=heard)  # type: ignore[arg-type]
    assert block.geodetic.active.all()
    assert "P" in block.points.id
    assert any("no <point>" in text and "P" in text for text in heard.warned)


def test_a_network_is_written_as_tables_that_read_the_same(tmp_path: Path) -> None:
    path, folder = tmp_path / "network.gkf", tmp_path / "tables"
    path.write_text(NETWORK)
    outcome = CliRunner().invoke(app, ["convert", str(path), str(folder), "--to", "tables"])
    assert outcome.exit_code == 0, outcome.stderr
    given, again = read_gama(path), read_block(folder)
    assert again.geodetic.type.tolist() == given.geodetic.type.tolist()
    assert again.geodetic.value.tolist() == pytest.approx(given.geodetic.value.tolist(), rel=1e-14)
    assert again.geodetic_covariances.value.tolist() == pytest.approx(given.geodetic_covariances.value.tolist())
    assert again.ground_points.role.tolist() == given.ground_points.role.tolist()
