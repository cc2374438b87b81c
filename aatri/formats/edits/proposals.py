"""Edits that an adjustment proposes: what it left out, numbers it found exchanged or wrong, weights that do not fit."""

from collections import Counter

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import ProposedNumbers, Solution, VarianceComponents
from aatri.artifacts.suspects import Suspects
from aatri.formats.edits.edit import BY_COORDINATE, NAMED_BY, TAKES, Edit
from aatri.formats.edits.edited import measured_value


def proposals(block: Block, solution: Solution, stage: str) -> tuple[tuple[Edit, ...], tuple[str, ...]]:
    """All that can be edited, and the kinds that cannot, with the number of each.

    Ties of models and strips are measured nowhere, relative control stands in block.yaml, and standard deviations of a
    camera or flight have no edit.

    Parameters
    ----------
    block : Block
        That the solution was made of.
    stage : str
        Its stage, for the reasons.
    """
    numbers = [] if solution.proposed_numbers is None else _of_numbers(block, solution.proposed_numbers, stage)
    numbered = {(edit.kind, row) for edit, rows in numbers for row in rows}
    left_out, others = _of_suspects(block, solution.suspects, stage, numbered)
    weights, unweighted = _of_components(block, solution.variance_components, stage)
    return (*(edit for edit, _ in numbers), *left_out, *weights), (*others, *unweighted)


def _of_numbers(block: Block, numbers: ProposedNumbers, stage: str) -> list[tuple[Edit, list[int]]]:
    """Exchanged and wrong numbers, with the rows that each accounts for; two that are exchanged are one edit."""
    edits = dict[tuple[str, str, frozenset[str]], tuple[Edit, list[int]]]()
    for k, (kind, row) in enumerate(zip(numbers.kind.tolist(), numbers.row.tolist())):
        image, point, to = str(numbers.image[k]), str(numbers.point[k]), str(numbers.proposed[k])
        do = "exchange" if numbers.exchanged[k] else "renumber"
        key = (kind, image, frozenset((point, to) if numbers.exchanged[k] else (point,)))
        if row < 0 or kind not in TAKES[do]:
            continue
        if key in edits:
            edits[key][1].append(row)
            continue
        ids = {"image": image, "point": point, "to": to} if kind == "image_point" else {"point": point, "to": to}
        value = measured_value(block, kind, row)
        edits[key] = Edit(do, kind, ids, value=value, reason=f"{stage}: fits {to}"), [row]
    return list(edits.values())


def _of_suspects(
    block: Block, suspects: Suspects, stage: str, numbered: set[tuple[str, int]]
) -> tuple[list[Edit], list[str]]:
    """What stays out and is not renumbered; and of which kinds there is no row in the tables of measurements."""
    edits, others = list[Edit](), Counter[str]()
    for k in np.flatnonzero(suspects.staying_out).tolist():
        kind, row = str(suspects.kind[k]), int(suspects.row[k])
        if (kind, row) in numbered:
            continue
        family = kind if kind in NAMED_BY else "geodetic"
        if row < 0 or (family == "geodetic" and not (row < len(block.geodetic) and block.geodetic.type[row] == kind)):
            others[kind] += 1
            continue
        value, reason = measured_value(block, family, row), _reason(suspects, k, stage)
        edits.append(Edit("switch_off", kind, _ids(block, kind, row), value=value, reason=reason))
    return edits, [f"{kind.replace('_', ' ')} ({n})" for kind, n in others.items()]


def _of_components(block: Block, components: VarianceComponents | None, stage: str) -> tuple[list[Edit], list[str]]:
    """Standard deviations that their residuals contradict: those of whole kinds, of plan and height, and of groups."""
    edits, others = list[Edit](), list[str]()
    if components is None:
        return edits, others
    for k in np.flatnonzero(components.verdict == "proposed").tolist():
        kind, *words = str(components.group[k]).split(" ")
        coordinates = _PARTS.get(words[0], "XYZ") if words and kind in BY_COORDINATE else "XYZ"
        words = words[coordinates != "XYZ" :]
        family = "geodetic" if kind in block.geodetic.type else kind
        if family not in TAKES["reweight"] or (words and words[0] != "group"):
            others.append(f"standard deviation of {components.group[k]} ({components.factor[k]:.3g} times)")
            continue
        ids = {"group": " ".join(words[1:])} if words else {}
        factor, limits = float(f"{components.factor[k]:.3g}"), f"{components.low[k]:.3g} to {components.high[k]:.3g}"
        edits.append(Edit("reweight", kind, ids, coordinates, factor=factor, reason=f"{stage}: {limits}, 95 %"))
    return edits, others


_PARTS = {"plan": "XY", "height": "Z"}


def _ids(block: Block, kind: str, row: int) -> dict[str, str]:
    if kind == "image_point":
        m = block.image_points
        return {"image": str(block.images.id[m.image[row]]), "point": str(block.points.id[m.point[row]])}
    if kind == "fiducial":
        f = block.fiducial_points
        return {"image": str(block.images.id[f.image[row]]), "point": str(block.fiducials.id[f.fiducial[row]])}
    if kind == "control":
        return {"point": str(block.points.id[block.ground_points.point[row]])}
    if kind in ("position", "attitude"):
        return {"image": str(block.images.id[block.exterior.image[row]])}
    g = block.geodetic
    ids = {"from": str(g.start[row]), "to": str(g.end[row]), "via": str(g.via[row])}
    return {key: name for key, name in ids.items() if name}


def _reason(suspects: Suspects, k: int, stage: str) -> str:
    """`bundle: rejected, 34 um, 12 sigma`."""
    size, unit = float(suspects.size[k]), str(suspects.unit[k])
    size, unit = (1e3 * size, "um") if unit == "mm" else (size, unit)
    text = f"{stage}: {suspects.verdict[k]}"
    if np.isfinite(size):
        text += f", {size:.3g} {unit}"
    return f"{text}, {float(suspects.test[k]):.3g} sigma" if np.isfinite(suspects.test[k]) else text
