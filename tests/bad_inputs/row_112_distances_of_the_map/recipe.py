"""Row 112: Distances on the ground of a map, 400 ppm too long."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, more, said

DISTANCES = """\
type,from,to,value,sigma
distance,GCP01,GCP03,782.320,0.01
distance,GCP02,GCP04,782.340,0.01
distance,GCP01,GCP02,673.070,0.01
distance,GCP03,GCP04,673.030,0.01
"""


def make(folder: Path) -> list[str] | None:
    film(folder, more("geodetic.csv", DISTANCES), said("units: {", "units: {"), bundle="")
    return None
