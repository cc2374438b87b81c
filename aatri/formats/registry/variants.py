"""Variants: files of one folder that hold the same block, or lists, in another form; of each the fuller one is taken.

A source is within another one if that has everything it has: its kinds of content; its images, by the rule of names;
control, check points and observed positions at the same places, with standard deviations where it has them; and its
image points. Two that each have cameras and image points are a block by themselves, whose points need not have the
same names: of these the one with fewer image points is within the other. What is within another source is left out,
by a note. A file that the user has named is never left out.

Blocks of different images in one folder, and several networks, are not joined: the user chooses. A network whose points
images show is one block with these.
"""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aatri.codes import CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import InputError
from aatri.formats.conventions.names import OF_IMAGES, OF_POINTS, Step, matched
from aatri.formats.limits import SAME_M, SAME_PX
from aatri.formats.parts.block_parts import BlockParts, Rows, rows_of
from aatri.formats.registry.recognised import Recognised
from aatri.ids import shown
from aatri.progress import Reporter


def fuller_ones(
    sources: Sequence[Recognised], parts: Sequence[BlockParts], named: Collection[Path], reporter: Reporter
) -> list[int]:
    """The sources that are taken, by their numbers.

    Parameters
    ----------
    sources, parts : sequence
        Sources, and what each gives.
    named : collection of Path
        Files that are taken whatever the others have.
    reporter : Reporter
        Told what is left out, and why.

    Raises
    ------
    InputError
        If they are several blocks.
    """
    order = sorted(range(len(parts)), key=lambda k: (-len(parts[k].image_points.get("image", ())), -_stated(parts[k])))
    kept: list[int] = []
    for k in order:
        fuller = next((m for m in kept if _is_within(parts[k], parts[m])), None)
        if fuller is None or sources[k].path in named:
            kept.append(k)
            continue
        what = f"{sources[k].path} is left out: all it has is in {sources[fuller].path}, the fuller one"
        reporter.log(f"{what}{_counts(parts[k], parts[fuller])}; to take it: --without {sources[fuller].path.name}")
    _refuse_several([sources[k] for k in kept], [parts[k] for k in kept])
    return sorted(kept)


def _stated(parts: BlockParts) -> int:
    """Standard deviations of ground points that are stated."""
    rows = rows_of(parts, "ground_points")
    return int((rows["covariance_m2"] > 0).sum()) if rows else 0


def _counts(less: BlockParts, more: BlockParts) -> str:
    counts = [len(p.image_points.get("image", ())) for p in (less, more)]
    return f" ({counts[0]} of {counts[1]} image points)" if all(counts) else ""


def _refuse_several(sources: Sequence[Recognised], parts: Sequence[BlockParts]) -> None:
    """Refuse several networks, and blocks of different images."""
    blocks: list[tuple[dict[str, None], list[int]]] = []
    for k, of_source in enumerate(parts):
        images = dict.fromkeys(_images(of_source))
        same = next((b for b in blocks if images and matched(images, b[0]).name), None)
        if same is not None:
            same[0].update(images)
            same[1].append(k)
        elif images or ("geodetic" in of_source.others and not _shares_points(of_source, parts)):
            blocks.append((images, [k]))
    if len(blocks) < 2:
        return
    texts = []
    for images, members in blocks:
        paths = shown([sources[k].path.name for k in members], 3)
        points = len(parts[members[0]].ground_points.get("point", ()))
        texts.append(f"{paths} ({f'{len(images)} images' if images else f'network of {points} points'})")
    first = sources[blocks[0][1][0]].path
    what = f"{len(blocks)} blocks that have no image in common: {'; '.join(texts)}"
    remedy = f"give the files of one, --from {first} ...; or leave out those of the others, --without NAME for each"
    remedy += "; blocks that are to be one: `block/merged`, docs/methods/merging.md"
    raise InputError(what, where=str(first.parent), remedy=remedy)


def _shares_points(network: BlockParts, parts: Sequence[BlockParts]) -> bool:
    """Whether images show points of a network, so that both are one block (`block/merged`)."""
    points = {str(name) for name in network.ground_points.get("point", ())}
    return any(points & {str(name) for name in p.image_points.get("point", ())} for p in parts)


def _images(parts: BlockParts) -> list[str]:
    columns = (parts.images.get("id"), parts.image_points.get("image"), parts.exterior.get("image"))
    return [str(name) for column in columns if column is not None for name in column]


def _is_within(less: BlockParts, more: BlockParts) -> bool:
    """Whether a source has nothing that the other one has not."""
    if "geodetic" in less.others or not _contents(less) <= _contents(more):
        return False
    images = _names(_images(less), _images(more), OF_IMAGES)
    if images is None or (not images and not _has_cameras_of(less, more)):
        return False
    points = _image_points_within(less, more, images)
    return points and _ground_points_within(less, more) and _positions_within(less, more, images)


def _contents(parts: BlockParts) -> set[str]:
    """Kinds of content; start values of points are of no own worth beside other image points."""
    roles = np.asarray(parts.ground_points.get("role", CONTROL if parts.ground_points else 0))
    uses = {
        f"observed {kind}"
        for kind in ("position", "angle")
        if OBSERVED_VALUE in np.ravel(parts.exterior.get(f"{kind}_use", 0))
    }
    tables = {name for name in ("cameras", "image_points", "exterior") if getattr(parts, name)}
    paths = {"photographs"} if any(parts.images.get("path", ())) else set()
    surveyed = {name for name, code in (("control", CONTROL), ("check points", CHECK)) if (roles == code).any()}
    return tables | uses | paths | surveyed | {k for k, v in parts.others.items() if hasattr(v, "__len__") and len(v)}


def _names(less: Sequence[str], more: Sequence[str], steps: tuple[Step, ...]) -> dict[str, str] | None:
    """What the names of a source are in the other one; None if one is not there."""
    matching = matched(dict.fromkeys(less), dict.fromkeys(more), steps)
    return None if matching.unmatched else dict(matching.name)


def _has_cameras_of(less: BlockParts, more: BlockParts) -> bool:
    """Whether the cameras of a source without images are among those of the other one, with the same values."""
    ours, theirs = rows_of(less, "cameras"), rows_of(more, "cameras")
    if not ours:
        return True
    row = {str(name): k for k, name in enumerate(theirs["id"])}
    at = [row.get(str(name), -1) for name in ours["id"]]
    return min(at) >= 0 and np.allclose(ours["principal_distance_mm"], theirs["principal_distance_mm"][at])


def _image_points_within(less: BlockParts, more: BlockParts, images: dict[str, str]) -> bool:
    ours, theirs = rows_of(less, "image_points"), rows_of(more, "image_points")
    if not ours:
        return True
    if less.cameras and more.cameras:
        return len(ours["image"]) <= len(theirs["image"])
    if less.pixel_axes != more.pixel_axes:
        return False
    there = {(str(i), str(p)): xy for i, p, xy in zip(theirs["image"], theirs["point"], theirs["xy"])}
    here = [there.get((images[str(i)], str(p))) for i, p in zip(ours["image"], ours["point"])]
    return all(xy is not None and np.abs(xy - own).max() <= SAME_PX for xy, own in zip(here, ours["xy"]))


def _ground_points_within(less: BlockParts, more: BlockParts) -> bool:
    ours, theirs = _surveyed(less), _surveyed(more)
    names = _names(list(ours), list(theirs), OF_POINTS)
    if names is None or (ours and less.frame != more.frame):
        return False
    for name, (xyz, covariance) in ours.items():
        there, own = theirs[names[name]]
        if not np.allclose(xyz, there, rtol=0, atol=SAME_M, equal_nan=True):
            return False
        if ((covariance > 0) & ~(own > 0)).any():
            return False
    return True


def _surveyed(parts: BlockParts) -> dict[str, tuple[Any, Any]]:
    """Coordinates and covariances of control and check points."""
    rows: Rows = rows_of(parts, "ground_points")
    if not rows:
        return {}
    kept = np.isin(rows["role"], (CONTROL, CHECK)).any(axis=1)
    return {str(p): (x, c) for p, x, c in zip(*(rows[k][kept] for k in ("point", "xyz_m", "covariance_m2")))}


def _positions_within(less: BlockParts, more: BlockParts, images: dict[str, str]) -> bool:
    """Whether the other one has the positions of a source at the same places.

    Start values that come with cameras are results of a program, of which one is enough; a list of positions may have
    been measured though it does not say so.
    """
    ours, theirs = rows_of(less, "exterior"), rows_of(more, "exterior")
    if not ours:
        return True
    there = {str(i): k for k, i in enumerate(theirs["image"])}
    compared = (ours["position_use"] == OBSERVED_VALUE) | (not less.cameras)
    for k in np.flatnonzero(compared):
        at = there.get(images[str(ours["image"][k])], -1)
        if at < 0 or less.frame != more.frame or theirs["position_use"][at] < ours["position_use"][k]:
            return False
        if not np.allclose(theirs["position_m"][at], ours["position_m"][k], rtol=0, atol=SAME_M, equal_nan=True):
            return False
    return True
