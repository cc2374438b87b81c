"""What a stage has rejected as gross errors, by name and size; what control never reached it."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.statistics.exchanged import exchanged_pairs
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.ids import shown
from aatri.notes import Note


def rejection_notes(suspects: Suspects, role: str) -> list[Note]:
    """A warning for each kind of observation of which a stage rejected some, the largest first.

    Parameters
    ----------
    suspects : Suspects
    role : str
        Role of the stage.
    """
    mine = (suspects.stage == role) & (suspects.verdict == "rejected")
    notes = []
    for kind in np.unique(suspects.kind[mine]).tolist():
        rows = np.flatnonzero(mine & (suspects.kind == kind))
        rows = rows[np.argsort(-np.nan_to_num(np.abs(suspects.test[rows])), kind="stable")]
        ids = tuple(_named(suspects, int(row)) for row in rows)
        notes.append(Note("warning", f"{kind}: {len(rows)} rejected as gross errors", ids))
    return notes


def _named(suspects: Suspects, row: int) -> str:
    name = "/".join(part for part in (str(suspects.image[row]), str(suspects.point[row])) if part)
    size, test = float(abs(suspects.size[row])), float(abs(suspects.test[row]))
    if not np.isfinite(size) or not np.isfinite(test):
        return name
    if suspects.stage[row] == "relative_orientation" and test < SMALL:
        return f"{name} (its rays meet behind the cameras)"
    return f"{name} ({size:.3g} {suspects.unit[row]}, {test:.3g} sigma)"


def lost_control(block: Block, point: Int, present: Bool, suspects: Suspects) -> list[Note]:
    """Control points that are measured, but in no model: why they take no part.

    Parameters
    ----------
    block : Block
    point : (n,) int
        Control points, rows of points.
    present : (n,) bool
        They are in an oriented component.
    suspects : Suspects
        Of the stages before.
    """
    rows = block.image_points
    shows = np.bincount(rows.point[rows.active & block.images.active[rows.image]], minlength=len(block.points))
    rejected = set(suspects.point[(suspects.verdict == "rejected") & (suspects.point != "")].tolist())
    told = []
    for k in point[~present & (shows[point] > 0)].tolist():
        name, count = str(block.points.id[k]), int(shows[k])
        why = f"rejected before, {count} images show it" if name in rejected else f"in no model, {count} images show it"
        told.append(f"{name} ({'one image shows it' if count == 1 else why})")
    if not told:
        return []
    text = "control that takes no part here, for relative orientation gave no model point of it"
    return [Note("warning", text, tuple(told))]


def exchanged_control(ids: list[str], found_m: Float, given_m: Float, rejected: Bool) -> list[Note]:
    """Pairs of rejected control points that fit with their numbers exchanged.

    Parameters
    ----------
    ids : list of str
    found_m, given_m : (n, 3) float64, m
        Where the images put each point, and where it is given; NaN not given.
    rejected : (n,) bool
    """
    rows = np.flatnonzero(rejected & np.isfinite(given_m).any(axis=1)).tolist()
    pairs = [f"{ids[pair.first]} and {ids[pair.second]}" for pair in exchanged_pairs(found_m, given_m, rows)]
    if not pairs:
        return []
    return [Note("warning", f"rejected control fits with the numbers exchanged, mend the ids: {shown(pairs)}")]


SMALL = 2.0
"""Relative orientation rejects points for large residuals, and with small ones for this reason alone."""
