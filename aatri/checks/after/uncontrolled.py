"""Observations that nothing controls.

Seen: nothing: a gross error there changes no residual.
Test: the redundancy number in the direction that the others control least is below `LEAST_CONTROLLED`,
where one of 41 standard deviations is found in 80 %. What is known beforehand of the film of single images is often
known by that alone, in image after image: such are counted. Image points in no model take part only in the bundle.
"""

import numpy as np

from aatri.adjustment.statistics.limits import LEAST_CONTROLLED
from aatri.artifacts.suspects import Uncontrolled
from aatri.checks.finding import Finding
from aatri.ids import several
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.poses import FILM_PRIOR

WHERE = f"(redundancy number below {LEAST_CONTROLLED:g}): a gross error along it shows nowhere (table `uncontrolled`)"


def uncontrolled_observations(table: Uncontrolled | None) -> list[Finding]:
    """How many of each kind, and which; of image points the points, of corrections of the film a count."""
    findings = list[Finding]()
    if table is None:
        return findings
    film, table = table.take(table.kind == FILM_PRIOR), table.take(table.kind != FILM_PRIOR)
    apart = np.asarray((table.kind == IMAGE_POINT) & np.isnan(table.direction).all(axis=1))
    in_no_model, table = table.take(apart), table.take(~apart)
    if len(in_no_model):
        points = np.unique(in_no_model.point)
        rays, of_points = several(len(in_no_model), "ray"), several(len(points), "point")
        text = f"{rays} to {of_points} in no model: the bundle is the first to check them"
        findings.append(Finding("uncontrolled", "note", text, ids=tuple(points.tolist()), where=IMAGE_POINT))
    for kind in np.unique(table.kind).tolist():
        of_kind = table.take(table.kind == kind)
        have = f"{'has' if len(of_kind) == 1 else 'have'} a direction that nothing controls {WHERE}"
        ids = tuple("/".join(x for x in pair if x) for pair in zip(of_kind.image.tolist(), of_kind.point.tolist()))
        text = f"{len(of_kind)} {have}"
        if kind == IMAGE_POINT:
            ids = tuple(np.unique(of_kind.point).tolist())
            text = f"{len(of_kind)} at {several(len(ids), 'point')} {have}"
        findings.append(Finding("uncontrolled", "note", text, ids=ids, where=kind, rows={kind: of_kind.row}))
    if len(film):
        what = f"{several(len(film), 'correction')} of the film of {several(len(np.unique(film.image)), 'image')}"
        labels = ", ".join(np.unique(film.point).tolist())
        text = f"{what} ({labels}) are known from the interior orientation alone; not listed"
        findings.append(Finding("uncontrolled", "note", text, where=FILM_PRIOR))
    return findings
