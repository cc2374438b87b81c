"""Control points with each other's number, which an adjustment could not leave out.

Seen: two control points fit only with their numbers exchanged.
Test: `adjustment.statistics.exchanged`: the start finds each at the coordinates of the other, to a fifth of their
distance, and a quarter of the control where it is given. An error where one of the two is exact, or fewer than three
other points would remain; else the search for gross errors leaves them out and names them.
"""

from aatri.adapters.exchanged_at_start import exchanged_control_at_start
from aatri.adapters.imported import read_at
from aatri.checks.finding import Finding
from aatri.checks.limits import ENOUGH_CONTROL
from aatri.observations.control import control_of
from aatri.observations.observed import ObservationSource
from aatri.orientation.bundle.block import BundleInput
from aatri.units import length


def exchanged_control(source: ObservationSource, inputs: BundleInput) -> list[Finding]:
    """Control points that the start finds at each other's coordinates, and that cannot be left out."""
    block = source.block
    few = int(control_of(block).given.any(axis=1).sum()) - 2 < ENOUGH_CONTROL
    findings = []
    for two in exchanged_control_at_start(inputs):
        if not (few or two.exact):
            continue
        (first, second), pair = block.points.id[two.points].tolist(), two.pair
        text = (
            f"control points {first} and {second} fit with their numbers exchanged, to {length(pair.exchanged_m)}; "
            f"as given they lie {length(pair.as_given_m)} from where the images find them"
        )
        remedy = "exchange the two ids in the control, or in the images"
        where, ratio = read_at(block, block.ground_points, int(two.rows[0])), pair.exchanged_m / pair.as_given_m
        findings.append(
            Finding(
                "exchanged_control", "error", text, remedy, where=where, rows={"control": two.rows}, statistic=ratio
            )
        )
    return findings
