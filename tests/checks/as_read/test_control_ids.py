"""Control whose ids are written otherwise than in the images, or that is called approximate, is not lost in silence."""

from __future__ import annotations

import unicodedata
from pathlib import Path

import pytest

from aatri.errors import AatriError
from tests.checks.as_read.test_screening import Written
from tests.stages.hand_block import Heard


def named(old: str, new: str, points: int = 10) -> Written:
    """A block whose points are called `old` in the images and `new` on the ground."""
    of = Written()
    of.points = [row.replace(",p", f",{old}") for row in of.points]
    of.ground = [f"{new}{k},{k},{2 * k},{k * k},control" for k in range(points)]
    return of


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("GCP-", "gcp-"),
        ("Größe", "GRÖSSE"),
        (unicodedata.normalize("NFD", "é"), "é"),
        ("G", "Ｇ"),
        ("P0", "P"),
        ("00", ""),
        ("P_", "P-"),
        ("P ", "P"),
    ],
)
def test_control_under_other_names_is_an_error_that_names_them(tmp_path: Path, old: str, new: str) -> None:
    if old == "P ":
        old, new = "P 1-", "P_1-"
    with pytest.raises(AatriError, match="no control point is measured; did you mean") as caught:
        named(old, new).read(tmp_path)
    assert caught.value.exit_code == 3
    assert "ground_points.csv:2" in str(caught.value)


def test_one_point_under_another_name_is_a_warning(tmp_path: Path) -> None:
    of, heard = named("GCP", "GCP"), Heard()
    of.ground[3] = of.ground[3].replace("GCP", "gcp")
    of.read(tmp_path, heard)
    assert any("did you mean 'GCP3' for 'gcp3'" in w for w in heard.warned)


def test_control_elsewhere_is_no_error(tmp_path: Path) -> None:
    heard = Heard()
    named("tie", "GCP").read(tmp_path, heard)
    assert not any("did you mean" in w for w in heard.warned)


def test_control_that_is_all_approximate_is_an_error(tmp_path: Path) -> None:
    of = named("p", "p")
    of.ground = [row.replace("control", "approximate") for row in of.ground]  # block.yaml has sigma.control
    with pytest.raises(AatriError, match="no ground point is control or check, all are approximate") as caught:
        of.read(tmp_path)
    assert "ground_points.csv:2" in str(caught.value)
    of.ground[0] = of.ground[0].replace("approximate", "check")
    of.read(tmp_path)
