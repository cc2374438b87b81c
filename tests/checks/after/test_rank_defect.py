"""The remedy of a rank defect by what is open: motions of the whole or a part, and unknowns by label and group."""

import pytest

from aatri.adjustment.openness.open_directions import OpenCombination, OpenError
from aatri.checks.after.rank_defect import rank_advice
from aatri.errors import GeometryError

WHOLE = {
    "datum": ({"shift", "azimuth"}, (), "three points off one line"),
    "turn about a line": ({"tilt"}, (), "a height away from it"),
    "size": ({"scale"}, (), "give the size"),
    "orientation of sets": ({"azimuth"}, (("orientation", "orientation"),), "no azimuth orients it"),
    "shift of all groups": ({"shift"}, (("shift X", "drift"),), "every group of positions has a shift"),
    "boresight": ({"azimuth"}, (("boresight z", "boresight"),), "hold no azimuth"),
}


def _advice(*combinations: OpenCombination, names: tuple[str, ...] = ()) -> str:
    error = OpenError("open", remedy="", combinations=combinations)
    return rank_advice(error, names, {"c": "c"})


@pytest.mark.parametrize("case", WHOLE)
def test_a_motion_of_the_whole_has_its_remedy_and_no_other(case: str) -> None:
    moves, unknowns, words = WHOLE[case]
    found = _advice(OpenCombination("text", frozenset(moves), True, unknowns))
    assert words in found
    assert not any(other in found for _, _, other in WHOLE.values() if other != words)


def test_a_part_is_joined_by_more_points() -> None:
    assert "too few points join it" in _advice(OpenCombination("text", frozenset({"shift"})))


def test_parameters_are_told_with_what_they_free() -> None:
    found = _advice(OpenCombination("text", unknowns=(("c", "additional"), ("Z0", "image"))), names=("c",))
    assert "nearly flat terrain" in found
    assert "`self_calibration.sigma_um`" in found
    of_camera = _advice(
        OpenCombination("text", unknowns=(("principal_distance", "camera"),)), names=("principal_distance",)
    )
    assert "`sigmas` of the camera" in of_camera


def test_an_error_that_names_no_combinations_has_no_remedy_of_its_own() -> None:
    assert rank_advice(GeometryError("shift X of the whole block"), ("c",), {}) == ""
