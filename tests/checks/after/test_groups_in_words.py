"""What groups of observations ask for, in words."""

import numpy as np

from aatri.checks.after.groups import wrong_groups
from aatri.orientation.bundle.groups.group import Group
from aatri.orientation.bundle.groups.search import AcceptedGroup


def test_values_have_two_digits_of_their_standard_deviation() -> None:
    """Pixels taken as 0.001 mm make the format of a camera 2 mm wide: its principal point is known to 0.1 um."""
    group = Group(
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
    (finding,) = wrong_groups((AcceptedGroup(group, False),), {}, {}, ())
    assert "lies -0.00812 (+- 0.00034), 0.000 (+- 0.012) mm off in x, y" in finding.sentence
