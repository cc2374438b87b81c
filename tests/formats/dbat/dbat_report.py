"""The numbers of a DBAT result file (`*-dbatreport.txt`), for comparison."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aatri.arrays import Float

SXB_OFFSET_M = np.array([999779.50631, 112260.591, 139.8321])
"""What the reports of SXB and its exports are reduced by: control file minus control points of the f-op0 export."""

INTERIOR = {
    "Camera Constant": "c",
    "px - principal point x": "px",
    "py - principal point y": "py",
    "K1 - radial distortion 1": "k1",
    "K2 - radial distortion 2": "k2",
    "K3 - radial distortion 3": "k3",
    "P1 - decentering distortion 1": "p1",
    "P2 - decentering distortion 2": "p2",
    "as - off-unit aspect parameter": "as",
}
EXTERIOR = ("Omega", "Phi", "Kappa", "Xc", "Yc", "Zc")


@dataclass(frozen=True)
class DbatReport:
    """A result file. Standard deviations are a posteriori (times sigma0); NaN where none is printed.

    Attributes
    ----------
    counts : (int, int, int)
        Observations, unknowns, redundancy.
    exterior, exterior_sigma : (n, 6)
        omega phi kappa in degrees, Xc Yc Zc; by photo.
    interior, interior_sigma : dict
        c px py k1 k2 k3 p1 p2 as, mm.
    control, control_sigma : dict
        Posterior coordinates of the control points and their standard deviations, by id.
    prior : dict
        Given coordinates and their standard deviations (6 values), by id.
    residual_rms_px : float
    """

    status: str
    sigma0: float
    sigma0_px: float
    counts: tuple[int, int, int]
    photos: list[str]
    exterior: Float
    exterior_sigma: Float
    interior: dict[str, float]
    interior_sigma: dict[str, float]
    prior: dict[str, Float]
    control: dict[str, Float]
    control_sigma: dict[str, Float]
    residual_rms_px: float


def read_report(path: Path) -> DbatReport:
    """Read a result file."""
    text = path.read_text()
    cameras = _between(text, "\n      Cameras:\n", "Precisions / Standard Deviations")
    photos = re.split(r"\n            Photo \d+: ", _between(text, "Photograph Standard Deviations", "\n   Quality"))[
        1:
    ]
    exterior = [[_item(photo, f"               {name}:") for name in EXTERIOR] for photo in photos]
    interior = {short: _item(cameras, f"            {name}:") for name, short in INTERIOR.items()}
    ctrl = _between(text, "      Ctrl measurements", "      Check measurements")
    posterior = _table(_between(ctrl, "Posterior", "Diff"), 6) if "Posterior" in ctrl else {}
    return DbatReport(
        status=_match(r"Status: +(.*)", text),
        sigma0=float(_match(r"Sigma0: +(\S+)", text)),
        sigma0_px=float(_match(r"Sigma0 \(pixels\): +(\S+)", text)),
        counts=(
            int(_match(r"Number of observations: +(\d+)", text)),
            int(_match(r"Number of params: +(\d+)", text)),
            int(_match(r"Redundancy +(\d+)", text)),
        ),
        photos=[photo.split("\n", 1)[0].strip() for photo in photos],
        exterior=np.array([[value for value, _ in row] for row in exterior]),
        exterior_sigma=np.array([[sigma for _, sigma in row] for row in exterior]),
        interior={name: value for name, (value, _) in interior.items()},
        interior_sigma={name: sigma for name, (_, sigma) in interior.items()},
        prior=_table(_between(ctrl, "Prior", "Posterior"), 6) if "Prior" in ctrl else {},
        control={name: row[:3] for name, row in posterior.items()},
        control_sigma={name: row[3:] for name, row in posterior.items()},
        residual_rms_px=float(_match(r"Overall point RMS: +(\S+)", text)),
    )


def _between(text: str, start: str, end: str) -> str:
    return text.split(start, 1)[1].split(end, 1)[0] if start in text else ""


def _match(pattern: str, text: str) -> str:
    found = re.search(pattern, text)
    return found.group(1).strip() if found else "nan"


def _item(text: str, head: str) -> tuple[float, float]:
    """Value and standard deviation below a heading."""
    body = _between(text, head + "\n", "\0")
    lines = []
    indent = len(head) - len(head.lstrip())
    for line in body.split("\n"):
        if len(line) - len(line.lstrip()) <= indent:
            break
        lines.append(line)
    item = "\n".join(lines)
    return float(_match(r"Value: +(\S+)", item)), float(_match(r"Deviation: +(\S+)", item))


def _table(text: str, columns: int) -> dict[str, Float]:
    rows = [[cell.strip() for cell in line.split(",")] for line in text.split("\n")]
    return {
        row[0]: np.array([float(cell) for cell in row[1 : columns + 1]])
        for row in rows
        if len(row) > columns and row[0].isdigit()
    }
