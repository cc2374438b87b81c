"""The file of non-photogrammetric observations beside the four of WuCAPS: PRENPI, written in their style.

The layout that WuCAPS itself has is not published. Here a line is an observation, `-99` ends the list:

    position photo X Y H sX sY sH                   projection centre: X north, Y east, m
    attitude photo phi omega kappa s s s            degrees
    distance | horizontal_distance | height_difference | azimuth | zenith    from to value sigma      m, degrees
    angle from at to value sigma                    at the second point, clockwise, degrees
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from aatri.arrays import finite_rows
from aatri.artifacts.block import OBSERVED_VALUE, PROJECTION_CENTRE, Block
from aatri.errors import Faults, raise_all
from aatri.formats.text.text_line import TextLine
from aatri.notes import Note

END = ("-99", "-99.0")


def ends(entry: TextLine) -> bool:
    """Whether a line ends a list."""
    return entry.words[0] in END


NAME = "PRENPI"
LENGTHS, ANGLES = ("distance", "horizontal_distance", "height_difference"), ("azimuth", "zenith", "angle")
WIDTHS = {"position": 8, "attitude": 8, "angle": 6} | dict.fromkeys((*LENGTHS, "azimuth", "zenith"), 5)
Columns = dict[str, Any]


def observations(entries: Sequence[TextLine]) -> tuple[Columns, Columns]:
    """Columns of exterior and of geodetic observations.

    Raises
    ------
    InputError
        If a line is not of its form, or observes a photo twice.
    """
    problems, first = Faults(), dict[str, TextLine]()
    photos, geodetic = dict[str, dict[str, TextLine]](), list[TextLine]()
    for entry in entries:
        if ends(entry):
            break
        kind = entry.words[0].lower()
        with problems.kept():
            if kind not in WIDTHS:
                raise entry.error(f"{entry.words[0]!r} is no kind of observation", f"one of {', '.join(WIDTHS)}")
            entry.of_width(WIDTHS[kind], f"{kind} and its values")
            if kind in ("position", "attitude"):
                entry.once(f"{kind} of photo {entry.words[1]}", first, "the")
                photos.setdefault(entry.words[1], {})[kind] = entry
            else:
                geodetic.append(entry)
            sigmas = entry.numbers(5) if kind in ("position", "attitude") else entry.numbers(WIDTHS[kind] - 1)
            if not min(sigmas) > 0:
                raise entry.error("a standard deviation that is not above 0", "leave the observation out")
    raise_all(problems)
    return _exterior(photos), _geodetic(geodetic)


def _exterior(photos: dict[str, dict[str, TextLine]]) -> Columns:
    if not photos:
        return {}
    missing = [np.nan] * 6
    values = {
        kind: np.array([seen[kind].numbers(2) if kind in seen else missing for seen in photos.values()])
        for kind in ("position", "attitude")
    }
    place, east_north = values["position"], [1, 0, 2]
    return {
        "image": list(photos),
        "position_m": place[:, :3][:, east_north],
        "sigma_m": place[:, 3:][:, east_north],
        "angles_rad": np.radians(values["attitude"][:, :3]),
        "angle_sigma_rad": np.radians(values["attitude"][:, 3:]),
        "position_use": np.where(np.isfinite(place[:, 0]), OBSERVED_VALUE, 0),
        "angle_use": np.where(np.isfinite(values["attitude"][:, 0]), OBSERVED_VALUE, 0),
        "at": [next(iter(seen.values())) for seen in photos.values()],
    }


def _geodetic(rows: Sequence[TextLine]) -> Columns:
    if not rows:
        return {}
    kind = [row.words[0].lower() for row in rows]
    unit = np.where(np.isin(kind, ANGLES), np.pi / 180, 1.0)
    angle = [k == "angle" for k in kind]
    return {
        "type": kind,
        "start": [row.words[1] for row in rows],
        "via": [row.words[2] if a else "" for row, a in zip(rows, angle)],
        "end": [row.words[3 if a else 2] for row, a in zip(rows, angle)],
        "value": unit * [row.number(len(row.words) - 2) for row in rows],
        "sigma": unit * [row.number(len(row.words) - 1) for row in rows],
        "at": list(rows),
    }


def observation_lines(block: Block) -> tuple[list[str], list[Note]]:
    """Lines of PRENPI, none where nothing is observed, and what has no place there."""
    lines, lost = list[str](), Counter[str]()
    e, g = block.exterior, block.geodetic
    off_diagonal = np.abs(np.nan_to_num(e.position_covariance_m2[:, [0, 0, 1], [1, 2, 2]])).max(axis=1, initial=0.0) > 0
    plain = (e.refers_to == PROJECTION_CENTRE) & (e.drift_group == "") & finite_rows(e.position_m)
    turned = finite_rows(e.angles_rad) & (block.rotation == "phi-omega-kappa")
    for row, image in enumerate(block.images.id[e.image].tolist()):
        if e.position_use[row] == OBSERVED_VALUE and plain[row] and not off_diagonal[row]:
            sigma = np.sqrt(np.diagonal(e.position_covariance_m2[row]))
            lines.append(_line("position", image, [*e.position_m[row][[1, 0, 2]], *sigma[[1, 0, 2]]]))
        elif e.position_use[row] == OBSERVED_VALUE:
            lost["positions of antennas, of drift groups, in part or with correlations"] += 1
        if e.angle_use[row] == OBSERVED_VALUE and turned[row]:
            lines.append(_line("attitude", image, np.degrees([*e.angles_rad[row], *e.angle_sigma_rad[row]])))
        elif e.angle_use[row] == OBSERVED_VALUE:
            lost["attitudes in part, or of another system than phi, omega, kappa"] += 1
    heights = (np.nan_to_num(g.start_height_m) != 0) | (np.nan_to_num(g.end_height_m) != 0)
    between = (g.start_kind == "point") & (g.end_kind == "point")
    written = g.active & between & np.isin(g.type, list(WIDTHS)) & (g.group == "") & (g.reduced == "no") & ~heights
    for row in np.flatnonzero(written).tolist():
        unit = 180 / np.pi if g.type[row] in ANGLES else 1.0
        names = [g.start[row], g.via[row], g.end[row]] if g.type[row] == "angle" else [g.start[row], g.end[row]]
        lines.append(_line(g.type[row], " ".join(names), unit * np.array([g.value[row], g.sigma[row]])))
    other = int((g.active & ~written).sum())
    if other:
        lost["geodetic observations of other types, with groups, heights or reductions"] = other
    notes = [
        Note("warning", f"{count} {what} have no place in {NAME} and are not written") for what, count in lost.items()
    ]
    return lines, notes


def _line(kind: str, names: str, values: Any) -> str:
    return " ".join([kind, names, *(repr(float(value)) for value in values)])
