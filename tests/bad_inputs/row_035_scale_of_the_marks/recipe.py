"""Row 35: Calibrated fiducial marks in inches where millimetres belong."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, said

MM = '"1": [106.002, -106.003], "2": [-106.001, -106.004], "3": [-106.0, 106.002], "4": [105.999, 106.002]'
INCHES = '"1": [4.17331, -4.17335], "2": [-4.17327, -4.17339], "3": [-4.17323, 4.17331], "4": [4.17319, 4.17331]'


def make(folder: Path) -> list[str] | None:
    film(folder, said(MM, INCHES), until="interior")
    return None
