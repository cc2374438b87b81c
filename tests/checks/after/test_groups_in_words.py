"""What groups of observations ask for, in words."""

from dataclasses import replace

import numpy as np

from aatri.checks.after.groups import wrong_groups
from aatri.orientation.bundle.groups.group import Group
from aatri.orientation.bundle.groups.search import AcceptedGroup

GROUP = Group(
    place=0,
    kind="image_point",
    per="camera",
    unit="k1",
    cause="principal point",
    rows=np.arange(4),
    H=np.zeros((4, 2, 2)),
    value=np.array([-0.00812, 0.0]),
    sigma=np.array([0.00034, 0.0121]),
    gain=900.0,
    sigma0=1.0,
)


def test_values_have_two_digits_of_their_standard_deviation() -> None:
    """Pixels taken as 0.001 mm make the format of a camera 2 mm wide: its principal point is known to 0.1 um."""
    (finding,) = wrong_groups((AcceptedGroup(GROUP, False),), {}, {}, ())
    assert "lies -0.00812 (+- 0.00034), 0.000 (+- 0.012) mm off in x, y" in finding.sentence


def test_a_line_of_flight_that_asks_for_another_camera_is_offered_what_helps() -> None:
    """Measured on the photographs of Brighton: docs/methods/tie_points.md."""
    group = replace(GROUP, per="line of flight", unit="DJI_0018 to DJI_0023")
    (finding,) = wrong_groups((AcceptedGroup(group, False),), {}, {}, ())
    assert finding.remedy.startswith("give its images a camera of their own (`camera` of images.csv)")


def test_a_line_of_flight_that_asks_for_an_affinity_is_asked_for_its_cause() -> None:
    value, sigma = np.array([0.02, 0.01]), np.array([0.001, 0.001])
    group = replace(GROUP, per="line of flight", unit="1 to 9", cause="affinity", value=value, sigma=sigma)
    (finding,) = wrong_groups((AcceptedGroup(group, False),), {}, {}, ())
    assert finding.remedy.endswith(
        "; without film: is it a rolling shutter (`readout_s`), or did shadows, leaves, water move "
        "(`mask` of images.csv)?"
    )
